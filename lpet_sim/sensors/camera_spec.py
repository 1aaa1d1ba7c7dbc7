"""What the stereo camera is, and what is declared of it; the two may differ."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import PoseSpec, StereoCalibration
from lpet_sim.spec import Spec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]

#: Focal length of a 1024 px wide camera with 65 deg field of view, the ExoMars LocCam's [recalled].
LOCCAM_FOCAL_PX = 804.0

_COARSE_CELL_M = 1.6 / 24  # a whole, even number of cells to the default's tile


class ImageChainSpec(Spec):
    """From radiance to numbers: optics, photons, electronics.

    Attributes:
        blur_sigma_px: Gaussian point spread of optics and pixel [px]; 0 is off. A choice: a
            well-focused rover camera spreads a point over about one pixel.
        vignetting: Strength of the natural ``cos^4`` fall-off, 0 none, 1 full. Cameras are
            flat-fielded on board, so that little is left.
        white_radiance: Radiance that fills the well, relative to a white Lambert surface that
            faces the sun. Mars ground is at 0.1-0.25.
        full_well_e: Full well [electrons]; 170,000 for the MER cameras [recalled].
        read_noise_e: Read noise, 1 sigma [electrons]; 25-50 for the MER cameras [recalled].
        photon_noise: Whether the photons' shot noise is on.
        bits: Depth of the numbers: 8 gives uint8, 12 gives uint16.
        encoding: ``linear``, or ``square_root`` as the MER cameras' tables that bring 12 bit to 8
            with even noise [recalled].
    """

    blur_sigma_px: NotNegative = 0.5
    vignetting: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    white_radiance: Positive = 0.55
    full_well_e: Positive = 170_000.0
    read_noise_e: NotNegative = 35.0
    photon_noise: bool = True
    bits: Literal[8, 12] = 8
    encoding: Literal["linear", "square_root"] = "square_root"

    @classmethod
    def ideal(cls, bits: Literal[8, 12] = 8) -> ImageChainSpec:
        """Make a chain that only quantises: no blur, vignetting or noise, linear."""
        return cls(
            blur_sigma_px=0.0,
            vignetting=0.0,
            read_noise_e=0.0,
            photon_noise=False,
            bits=bits,
            encoding="linear",
        )


class DeclaredErrorSpec(Spec):
    """By how much the declared calibration is off; all zero: the truth is declared.

    Attributes:
        disparity_bias_px: Bias of every measured disparity ``u_left - u_right`` against the
            declared model [px]. A vergence error of the right eye does this; it is put into the
            render, not into the calibration, which has one principal point.
        focal_scale_error: Declared over true focal length, less 1.
        baseline_scale_error: Declared over true baseline, less 1.
        rotation_rad: Right rotation of the declared against the true mount [rad].
    """

    disparity_bias_px: float = 0.0
    focal_scale_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    baseline_scale_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    rotation_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)


class GroundDetailSpec(Spec):
    """How finely the ground is drawn; none of it touches the physics.

    Attributes:
        texel_m: Finest texel; 3 mm is a pixel of a 65 deg camera 2.5 m away.
        tile_texels: Texels along a tile; four tiles span a level.
        cell_m: Finest cell of the mesh.
        levels: Nested levels, each two (from the fourth on, four) times the last one's size. The
            default reaches 13 km.
        ahead_m: How far ahead of the camera the finest level is centred.
        supersampling: Samples along a pixel's edge.
        rock_faces: Triangles there are for rocks; the largest in view angle come first.
    """

    texel_m: Positive = 0.003125
    tile_texels: Literal[128, 256, 512] = 512
    cell_m: Positive = 0.04
    levels: Annotated[int, Field(ge=1, le=8)] = 8
    ahead_m: NotNegative = 2.2
    supersampling: Literal[1, 2, 3] = 2
    rock_faces: Annotated[int, Field(ge=100, le=400_000)] = 112_000

    @model_validator(mode="after")
    def _cells_fit(self) -> Self:
        cells = self.tile_texels * self.texel_m / self.cell_m
        if abs(cells - round(cells)) > 1e-6 or round(cells) % 8 != 0 or round(cells) > 64:
            raise ValueError(
                "tile_texels * texel_m / cell_m, the cells along a tile, must be 8, 16, ... 64, "
                f"not {cells:g}"
            )
        return self


class StereoCameraSpec(Spec):
    """A stereo pair as it truly is, with what is declared wrongly of it.

    Pixel (0, 0) is the centre of the first one, so that a centred principal point is at
    ``(width_px - 1) / 2``. The default is a LocCam of 65 deg, 1024 x 1024 px and 0.15 m
    [recalled]; `small` gives its 640 x 480 px sister of the same field of view.

    Attributes:
        width_px: Image width.
        height_px: Image height.
        focal_px: True focal length [px].
        cx_px: True principal point along u [px]; None: the middle.
        cy_px: True principal point along v [px]; None: the middle.
        baseline_m: True distance between the eyes.
        mount: Pose of the left eye in the body; None: where the rover's model has its camera.
        sigma_px: Declared noise of a sighting's image coordinate, 1 sigma [px].
        chain: From radiance to numbers.
        declared_error: How the declared calibration is off.
        ground: How finely the ground is drawn.
    """

    width_px: Annotated[int, Field(ge=16, le=4096)] = 1024
    height_px: Annotated[int, Field(ge=16, le=4096)] = 1024
    focal_px: Positive = LOCCAM_FOCAL_PX
    cx_px: float | None = None
    cy_px: float | None = None
    baseline_m: Positive = 0.15
    mount: PoseSpec | None = None
    sigma_px: Positive = 0.5
    chain: ImageChainSpec = ImageChainSpec()
    declared_error: DeclaredErrorSpec = DeclaredErrorSpec()
    ground: GroundDetailSpec = GroundDetailSpec()

    @model_validator(mode="after")
    def _principal_point_inside(self) -> Self:
        for value, size in ((self.cx_px, self.width_px), (self.cy_px, self.height_px)):
            if value is not None and not 0 <= value < size:
                raise ValueError(f"the principal point must lie in the image, 0 to {size - 1} px")
        return self

    @classmethod
    def small(cls) -> StereoCameraSpec:
        """Make the 640 x 480 px camera with the default's horizontal field of view.

        Its pixels are 1.6 times as coarse as the default's, and so are the cells of its ground.
        """
        ground = GroundDetailSpec(cell_m=_COARSE_CELL_M)
        return cls(
            width_px=640, height_px=480, focal_px=LOCCAM_FOCAL_PX * 640 / 1024, ground=ground
        )

    @property
    def principal_px(self) -> tuple[float, float]:
        """True principal point (cx, cy) [px]."""
        cx = (self.width_px - 1) / 2 if self.cx_px is None else self.cx_px
        cy = (self.height_px - 1) / 2 if self.cy_px is None else self.cy_px
        return cx, cy

    def true_calibration(self, T_body_camera: SE3) -> StereoCalibration:
        """Give the calibration as it truly is, but for the disparity bias.

        Args:
            T_body_camera: True pose of the left eye in the body, unless the spec has a mount.
        """
        mount = PoseSpec.from_se3(T_body_camera) if self.mount is None else self.mount
        cx, cy = self.principal_px
        return StereoCalibration(
            width_px=self.width_px,
            height_px=self.height_px,
            focal_px=self.focal_px,
            cx_px=cx,
            cy_px=cy,
            baseline_m=self.baseline_m,
            T_body_camera=mount,
            sigma_px=self.sigma_px,
        )

    def declared_calibration(self, T_body_camera: SE3) -> StereoCalibration:
        """Give the calibration that the rover believes.

        Args:
            T_body_camera: True pose of the left eye in the body, unless the spec has a mount.
        """
        true, error = self.true_calibration(T_body_camera), self.declared_error
        mount = true.T_body_camera
        if any(error.rotation_rad):
            turn = SE3.exp([0.0, 0.0, 0.0, *error.rotation_rad])
            mount = PoseSpec.from_se3(mount.se3() @ turn)
        return true.model_copy(
            update={
                "focal_px": true.focal_px * (1 + error.focal_scale_error),
                "baseline_m": true.baseline_m * (1 + error.baseline_scale_error),
                "T_body_camera": mount,
            }
        )
