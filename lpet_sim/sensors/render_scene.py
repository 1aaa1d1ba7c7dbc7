"""MuJoCo's renderer, taught 16-bit radiance: meshes and textures that change while it runs.

A MuJoCo model holds one static geom for each mesh and the two cameras. No light is on: materials
shine by their texture, which carries the radiance. Textures and frame buffer are given 16 bits in
one channel, which is faster here than 8 bits in three and leaves the quantising to the image chain.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

os.environ.setdefault("PYOPENGL_PLATFORM", os.environ.get("MUJOCO_GL", "egl"))

import mujoco
import numpy as np
from numpy.typing import NDArray
from OpenGL import GL  # type: ignore[import-untyped]

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.rover.picture import offscreen_context
from lpet_sim.sensors.render_layout import Eye, MeshLayout

NEAR_M = 0.05
FAR_M = 40_000.0
_HIDDEN, _SHOWN = 5, 0
_OPTICAL_TO_GL = np.diag([1.0, -1.0, -1.0])


class RenderScene:
    """A set of textured meshes seen by some eyes, on an OpenGL context of its own."""

    def __init__(
        self,
        eyes: Sequence[Eye],
        meshes: Sequence[MeshLayout],
        texture_sizes: Sequence[int],
        supersampling: int,
        haze: tuple[float, float] = (0.0, FAR_M),
    ) -> None:
        """Compile the model and make the context.

        Args:
            eyes: The cameras.
            meshes: The meshes, all hidden at first.
            texture_sizes: Edge of each square texture [texels].
            supersampling: Samples along a pixel's edge.
            haze: Radiance of far haze, and the distance at which it hides all [m].

        Raises:
            UnknownNameError: MUJOCO_GL names no offscreen OpenGL.
        """
        self._meshes, self._texture_sizes = list(meshes), list(texture_sizes)
        self._width = supersampling * max(eye.width_px for eye in eyes)
        self._height = supersampling * max(eye.height_px for eye in eyes)
        self._model = self._compile(eyes, haze)
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._data.geom_xpos[:] = 0.0
        self._data.geom_xmat[:] = np.eye(3).ravel()
        self._scene = mujoco.MjvScene(self._model, maxgeom=len(meshes) + 16)
        self._scene.flags[:] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = haze[0] > 0
        self._rect = mujoco.MjrRect(0, 0, self._width, self._height)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._open()

    def _compile(self, eyes: Sequence[Eye], haze: tuple[float, float]) -> mujoco.MjModel:
        spec = mujoco.MjSpec()
        spec.visual.global_.offwidth, spec.visual.global_.offheight = self._width, self._height
        spec.visual.quality.offsamples = 0
        spec.visual.quality.shadowsize = 0
        spec.visual.headlight.active = 0
        spec.stat.extent = 1.0
        spec.visual.map.znear, spec.visual.map.zfar = NEAR_M, FAR_M
        spec.visual.map.fogstart, spec.visual.map.fogend = 0.0, haze[1]
        spec.visual.rgba.fog = [haze[0], haze[0], haze[0], 1.0]
        for index in range(len(self._texture_sizes)):
            _add_texture(spec, index)
        for index, mesh in enumerate(self._meshes):
            _add_mesh(spec, index, mesh)
        for eye in eyes:
            _add_eye(spec, eye)
        return spec.compile()

    def _open(self) -> None:
        """Make the context, and give its textures and buffer 16 bits."""
        self._gl = offscreen_context(self._width, self._height)
        self._gl.make_current()
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        for index, size in enumerate(self._texture_sizes):
            self._make_texture(index, size)
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, int(self._context.offColor))
        GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, GL.GL_R16, self._width, self._height)

    def _make_texture(self, index: int, size: int) -> None:
        self._bind(index)
        edge, step = size, 0
        while edge >= 1:
            GL.glTexImage2D(
                GL.GL_TEXTURE_2D, step, GL.GL_R16, edge, edge, 0,
                GL.GL_RED, GL.GL_UNSIGNED_SHORT, np.zeros((edge, edge), np.uint16),
            )  # fmt: skip
            edge, step = edge // 2, step + 1

    def _bind(self, index: int) -> None:
        GL.glBindTexture(GL.GL_TEXTURE_2D, int(self._context.texture[index]))
        GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)

    def sharpen(self, index: int, halvings: int, bias: float) -> None:
        """Set which of a texture's halvings are used.

        Args:
            index: The texture.
            halvings: How many are filled.
            bias: Steps finer than the coarser of a sample's two extents on the texture asks for.
        """
        self._gl.make_current()
        self._bind(index)
        GL.glTexParameteri(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_MAX_LEVEL, halvings)
        GL.glTexParameterf(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_LOD_BIAS, -bias)

    def upload_tile(
        self, index: int, column: int, row: int, images: Sequence[NDArray[np.uint16]]
    ) -> None:
        """Write a square of a texture.

        Args:
            index: The texture.
            column: First texel of the square along u.
            row: First texel along v.
            images: The square and its halvings, Shape (n, n), (n/2, n/2), ...
        """
        self._gl.make_current()
        self._bind(index)
        for step, image in enumerate(images):
            rows, columns = image.shape
            GL.glTexSubImage2D(
                GL.GL_TEXTURE_2D, step, column >> step, row >> step, columns, rows,
                GL.GL_RED, GL.GL_UNSIGNED_SHORT, np.ascontiguousarray(image),
            )  # fmt: skip

    def upload_mesh(
        self, index: int, corners: Array, texcoords: Array, kept: NDArray[np.bool_] | None = None
    ) -> None:
        """Write a mesh's corners.

        Args:
            index: The mesh.
            corners: Relative to the mesh's own origin [m], Shape (n, 3).
            texcoords: Place in the texture, 0 to 1, Shape (n, 2).
            kept: Which triangles are drawn, Shape (f,); None: all.
        """
        model, mesh = self._model, self._meshes[index]
        first = model.mesh_vertadr[index]
        model.mesh_vert[first : first + len(corners)] = corners
        first = model.mesh_texcoordadr[index]
        model.mesh_texcoord[first : first + len(texcoords)] = texcoords
        faces = mesh.faces if kept is None else mesh.faces[kept]
        first = model.mesh_faceadr[index]
        model.mesh_face[first : first + len(faces)] = faces
        model.mesh_facetexcoord[first : first + len(faces)] = faces
        model.mesh_facenum[index] = len(faces)
        self._gl.make_current()
        mujoco.mjr_uploadMesh(model, self._context, index)

    def place_mesh(self, index: int, origin: Array) -> None:
        """Put a mesh's origin where it belongs in the frame that is drawn in [m], Shape (3,)."""
        self._data.geom_xpos[index] = origin

    def draw(self, eye: int, T_draw_camera: SE3, shown: NDArray[np.bool_]) -> NDArray[np.uint16]:
        """Draw what an eye sees.

        Args:
            eye: Index of the eye.
            T_draw_camera: Its pose (optical frame) in the frame that is drawn in.
            shown: Which meshes are drawn, Shape (meshes,).

        Returns:
            Samples, supersampled, 65535 is radiance 1 and 0 is the sky, Shape (h, w); row 0 is
            the lowest.
        """
        self._gl.make_current()
        self._update(eye, T_draw_camera, shown)
        mujoco.mjr_render(self._rect, self._scene, self._context)
        out = np.empty((self._height, self._width), np.uint16)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
        GL.glReadPixels(0, 0, self._width, self._height, GL.GL_RED, GL.GL_UNSIGNED_SHORT, out)
        return out

    def draw_depth(self, eye: int, T_draw_camera: SE3, shown: NDArray[np.bool_]) -> Array:
        """Draw the inverse of the depth z of each sample [1/m], 0 where there is only sky."""
        self.draw(eye, T_draw_camera, shown)
        window = np.empty((self._height, self._width), np.float32)
        GL.glReadPixels(0, 0, self._width, self._height, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, window)
        # The renderer's depth runs from 1 at the near plane to 0 at the far one.
        near, far = np.float64(np.float32(NEAR_M)), np.float64(np.float32(FAR_M))
        return np.asarray((window * (far - near) + near) / (far * near) * (window > 0))

    def _update(self, eye: int, T_draw_camera: SE3, shown: NDArray[np.bool_]) -> None:
        self._model.geom_group[:] = np.where(shown, _SHOWN, _HIDDEN)
        self._data.cam_xpos[eye] = T_draw_camera.translation
        self._data.cam_xmat[eye] = (T_draw_camera.rotation @ _OPTICAL_TO_GL).ravel()
        self._camera.fixedcamid = eye
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, self._camera,
            mujoco.mjtCatBit.mjCAT_ALL.value, self._scene,
        )  # fmt: skip

    def close(self) -> None:
        """Free the context; the scene is of no use afterwards."""
        if self._gl is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None


def _add_texture(spec: mujoco.MjSpec, index: int) -> None:
    """Add a small texture; it gets its size when the context is there, and costs no memory here."""
    spec.add_texture(
        name=f"texture{index}",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        width=8,
        height=8,
    )
    material = spec.add_material(name=f"material{index}", emission=1.0, specular=0.0, shininess=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = f"texture{index}"


def _add_mesh(spec: mujoco.MjSpec, index: int, mesh: MeshLayout) -> None:
    """Add a mesh of the right counts; its shape is a place-holder until the first upload."""
    at = np.arange(mesh.corners)
    corners = np.stack([np.cos(at), np.sin(1.3 * at), np.cos(2.1 * at)], axis=1)
    spec.add_mesh(
        name=f"mesh{index}",
        uservert=corners.ravel(),
        userface=mesh.faces.ravel(),
        usertexcoord=np.zeros(2 * mesh.corners),
        userfacetexcoord=mesh.faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=f"mesh{index}",
        material=f"material{mesh.texture}",
        contype=0,
        conaffinity=0,
        group=_HIDDEN,
    )


def _add_eye(spec: mujoco.MjSpec, eye: Eye) -> None:
    """Add a camera; MuJoCo counts the principal point from the middle, leftwards and upwards."""
    spec.worldbody.add_camera(
        resolution=[eye.width_px, eye.height_px],
        sensor_size=[eye.width_px * 1e-5, eye.height_px * 1e-5],
        focal_pixel=[eye.focal_px, eye.focal_px],
        principal_pixel=[
            (eye.width_px - 1) / 2 - eye.cx_px,
            (eye.height_px - 1) / 2 - eye.cy_px,
        ],
        ipd=0.0,
    )
