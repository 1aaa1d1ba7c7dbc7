"""What is drawn of the rover moves as the physics moves it."""

import mujoco
import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.rover.drawing import link_poses, rover_drawing
from lpet_sim.rover.frames import body_pose, rover_frames
from lpet_sim.rover.mjcf import bare_model
from lpet_sim.rover.spec import RoverSpec

SPEC = RoverSpec()


def test_links_stand_where_mujoco_puts_them() -> None:
    """Every link's pose at random joint angles equals MuJoCo's."""
    model = bare_model("exomars")
    data = mujoco.MjData(model)
    rng = np.random.default_rng(5)
    pose = SE3.exp(rng.normal(size=6))
    data.qpos[:3], data.qpos[3:7] = pose.translation, pose.quat_wxyz()
    data.qpos[7:] = rng.uniform(-0.5, 0.5, model.nq - 7)
    mujoco.mj_kinematics(model, data)
    joints = [model.joint(i).name for i in range(1, model.njnt)]
    angles = {name: np.array([data.joint(name).qpos[0]]) for name in joints}
    for name, T_world_link in link_poses(rover_drawing(SPEC), SE3.stack([pose]), angles).items():
        np.testing.assert_allclose(T_world_link.translation[0], data.body(name).xpos, atol=1e-12)
        R = data.body(name).xmat.reshape(3, 3)
        np.testing.assert_allclose(T_world_link.rotation[0], R, atol=1e-12)


def test_meshes_are_closed_and_face_outwards() -> None:
    """Their signed volume is that of the box or the 24-sided cylinder they stand for."""
    for link in rover_drawing(SPEC).links:
        for mesh in link.meshes:
            a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
            centre = mesh.vertices.mean(axis=0)
            volume = np.einsum("ij,ij->i", a - centre, np.cross(b - centre, c - centre)) / 6
            assert volume.min() > 0


def test_the_camera_frames_are_optical_and_a_baseline_apart() -> None:
    """Right is x, ahead is z and 20 deg down; the right eye lies at +x of the left."""
    frames = rover_frames(SPEC)
    T_camera_right = frames.T_body_camera.inverse() @ frames.T_body_camera_right
    np.testing.assert_allclose(T_camera_right.translation, [0.15, 0, 0], atol=1e-12)
    np.testing.assert_allclose(T_camera_right.rotation, np.eye(3), atol=1e-12)
    down = np.radians(20)
    R = frames.T_body_camera.rotation
    np.testing.assert_allclose(R[:, 0], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(R[:, 2], [np.cos(down), 0, -np.sin(down)], atol=1e-12)


def test_the_model_has_the_numbers_it_says_it_has() -> None:
    """Mass, wheels, ride height and gravity as in the models' README."""
    frames = rover_frames(SPEC)
    assert frames.mass_kg == 310.0
    assert 2 * frames.wheel_radius_m == 0.285
    np.testing.assert_allclose(frames.ride_height_m, 0.30)
    assert frames.gravity_mps2 == 3.721
    assert frames.suspension_joints == ("bogie_left", "bogie_right", "bogie_rear")
    np.testing.assert_allclose(body_pose(SPEC, "mast").translation, [0.28, 0, 0.65])
