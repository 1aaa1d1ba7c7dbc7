"""Rovers of one's own: what their description may say, and that what it says is what drives."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from lpet_sim.errors import LpetError, SpecError, UnknownNameError
from lpet_sim.planning.mobility import MobilitySpec
from lpet_sim.rover.clearance import belly_height_m
from lpet_sim.rover.drawing import rover_drawing
from lpet_sim.rover.frames import rover_frames
from lpet_sim.rover.mjcf import bare_model
from lpet_sim.rover.model_spec import load_rover_model, model_names, wheel_names
from lpet_sim.rover.scene import build_scene
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.rover.wheel_parts import wheel_parts
from tests.rover.grounds import Waves
from tests.rover.own_models import changed, description, foreign_exomars, written


def _first_wheel(folder: Path, **changes: object) -> str:
    """Describe the prospector with something changed about its first wheel."""
    wheels = description("prospector")["wheels"]
    return changed(folder, "prospector", wheels=[{**wheels[0], **changes}, *wheels[1:]])


@pytest.mark.parametrize(
    ("what", "valid"),
    [
        ({"drive": "fl_rol"}, r"joint of drive of wheel front_left 'fl_rol': .*bl_roll, .*fl_roll"),
        ({"steer": "steer"}, r"joint of steer of wheel front_left 'steer': .*bl_steer, .*fl_steer"),
    ],
)
def test_a_wrong_name_of_a_wheel_is_answered_with_the_valid_ones(
    what: dict[str, str], valid: str, tmp_path: Path
) -> None:
    """The names are those of the user's model, without what is put before them inside."""
    with pytest.raises(UnknownNameError, match=valid) as found:
        bare_model(_first_wheel(tmp_path, **what))
    assert "own/" not in str(found.value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"camera": {"site": "nav"}}, r"site of camera 'nav': .*gyro_box, nav_left, nav_right"),
        ({"imu": {"link": "box"}}, r"link of imu 'box': .*bl_upright, .*chassis, .*mast"),
        ({"body": {"link": "bus"}}, r"link of body 'bus': .*chassis"),
        ({"suspension": ["r"], "differentials": []}, r"joint of suspension 'r': .*rocker_r"),
        ({"suspension": ["rocker_l"]}, r"'rocker_r' is held still; name it in suspension too"),
        ({"body": {"link": "fl_wheel"}}, r"'fl_wheel' moves against 'chassis'"),
        ({"model": "none.xml"}, r"cannot read .*none.xml: No such file"),
        ({"model": "prospector.xml", "wheel": 3}, r"unknown key 'wheel'; valid keys are model"),
        ({"wheels": [{"name": "a"}] * 3}, r"two wheels have the name 'a'"),
        ({"wheels": [{"name": n} for n in "abc"]}, r"wheel 'a' lacks drive"),
        ({"wheels": [{"name": "a", "drive": "x"}]}, r"wheels.*at least 3"),
        ({"camera": {"site": "nav_left", "link": "mast"}}, r"'nav_left' has its place already"),
        ({"camera": {"link": "mast", "optical": True, "pitch_down_rad": 1}}, r"optical axes say"),
        ({"body": {"q_wxyz": [0.7071, 0, 0, 0.7071]}}, r"'fl_roll' .* must be y \(left\)"),
        ({"wheels": description("scout")["wheels"]}, r"joint of drive of wheel front_left"),
    ],
)
def test_a_bad_description_is_refused_in_one_sentence(
    changes: dict[str, object], said: str, tmp_path: Path
) -> None:
    """Each says what is wrong, and what would be right."""
    with pytest.raises(LpetError, match=said) as found:
        bare_model(changed(tmp_path, "prospector", **changes))
    assert "\n" not in str(found.value)


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ("<mujoco><worldbody><bod/></worldbody></mujoco>", r"no model that MuJoCo reads: .*bod"),
        ("<robot name='r'><link", "no model that MuJoCo reads"),
        ("<mujoco/>", r"has 0 links at its top \(none\): name the rover's own as body.link"),
        (
            "<mujoco><worldbody><body name='a'><joint name='rail' type='slide'/>"
            "<geom size='1'/></body></worldbody></mujoco>",
            r"joint 'rail' ties 'a' to the world",
        ),
    ],
)
def test_a_model_that_is_none_is_refused(model: str, said: str, tmp_path: Path) -> None:
    """MuJoCo's own words in one sentence, with the file's name."""
    (tmp_path / "bad.xml").write_text(model)
    with pytest.raises(SpecError, match=said):
        bare_model(written(tmp_path, description("prospector", model="bad.xml")))


def test_the_model_in_place_of_its_description_is_told_apart() -> None:
    """An MJCF or URDF alone does not say what is a wheel; a name that is none lists ours."""
    with pytest.raises(SpecError, match=r"is the model itself: give the YAML"):
        load_rover_model("models/scout.urdf")
    with pytest.raises(UnknownNameError, match="exomars, prospector, scout"):
        load_rover_model("sojourner")


def test_a_foreign_model_is_fitted_with_just_what_our_own_has(tmp_path: Path) -> None:
    """Our own rover described as someone else's: every number of the compiled model agrees."""
    own, fitted = bare_model("exomars"), bare_model(foreign_exomars(tmp_path))
    names = wheel_names("exomars")
    ours, theirs = wheel_parts("exomars"), wheel_parts(str(tmp_path / "foreign.yaml"))
    assert theirs.names == names
    assert [name.removeprefix("own/") for name in theirs.suspension] == list(ours.suspension)
    for field in ("size", "friction", "solref", "solimp", "margin", "surfacevel", "contype"):
        values = [getattr(m, f"geom_{field}")[p.geom] for m, p in ((own, ours), (fitted, theirs))]
        np.testing.assert_array_equal(*values)
    for act, what in (("drive_act", "gainprm"), ("drive_act", "biasprm"), ("steer_act", "gainprm")):
        values = [
            getattr(m, f"actuator_{what}")[getattr(p, act)]
            for m, p in ((own, ours), (fitted, theirs))
        ]
        np.testing.assert_allclose(*values, rtol=1e-12)
    np.testing.assert_allclose(
        fitted.actuator_biasprm[theirs.steer_act], own.actuator_biasprm[ours.steer_act], rtol=1e-3
    )
    for option in ("gravity", "cone", "impratio", "integrator", "iterations", "noslip_iterations"):
        np.testing.assert_array_equal(getattr(fitted.opt, option), getattr(own.opt, option))
    assert fitted.opt.noslip_tolerance == own.opt.noslip_tolerance
    a, b = rover_frames(RoverSpec()), rover_frames(RoverSpec(model=str(tmp_path / "foreign.yaml")))
    np.testing.assert_allclose(b.wheel_position_body_m, a.wheel_position_body_m, atol=1e-12)
    np.testing.assert_allclose(b.T_body_camera.matrix(), a.T_body_camera.matrix(), atol=1e-12)
    assert b.mass_kg == pytest.approx(a.mass_kg, rel=1e-12)


def test_senses_of_joints_do_not_matter() -> None:
    """Right wheels roll about -y and steer about -z in the model; all are turned round."""
    model, parts = bare_model("prospector"), wheel_parts("prospector")
    frames = rover_frames(RoverSpec(model="prospector"))
    np.testing.assert_array_equal(model.jnt_axis[parts.drive], np.tile([0.0, 1.0, 0.0], (4, 1)))
    np.testing.assert_array_equal(model.jnt_axis[parts.steer], np.tile([0.0, 0.0, 1.0], (4, 1)))
    np.testing.assert_allclose(frames.steer_limit_rad, np.radians(60.0))
    assert frames.mass_kg == pytest.approx(430.0)
    assert frames.gravity_mps2 == 1.62
    assert frames.wheel_names == ("front_left", "front_right", "rear_left", "rear_right")


def test_the_users_own_motors_and_world_are_left_out() -> None:
    """Their floor, light and motor are gone; nothing of theirs collides."""
    model = bare_model("prospector")
    names = [model.actuator(k).name for k in range(model.nu)]
    assert sorted(name.split("_")[0] for name in names) == ["drive"] * 4 + ["steer"] * 4
    collide = [model.geom(k).name for k in range(model.ngeom) if model.geom_contype[k]]
    assert sorted(collide) == ["belly", *sorted(f"wheel_{n}" for n in wheel_names("prospector"))]
    assert model.nlight == 0


def test_the_body_is_where_its_description_puts_it(tmp_path: Path) -> None:
    """Moved by (0.1, 0, -0.2) and turned by half a turn about z: all else moves the other way."""
    body = {"translation_m": [0.1, 0.0, -0.2], "q_wxyz": [0.0, 0.0, 0.0, 1.0]}
    plain = rover_frames(RoverSpec(model="prospector"))
    moved = rover_frames(RoverSpec(model=changed(tmp_path, "prospector", body=body)))
    back = np.array([-1.0, -1.0, 1.0])
    expected = back * (plain.wheel_position_body_m - [0.1, 0.0, -0.2])
    np.testing.assert_allclose(moved.wheel_position_body_m, expected, atol=1e-12)
    eye = back * (plain.T_body_camera.translation - [0.1, 0.0, -0.2])
    np.testing.assert_allclose(moved.T_body_camera.translation, eye, atol=1e-12)
    np.testing.assert_allclose(moved.ride_height_m, plain.ride_height_m - 0.2)


def test_a_camera_looks_where_its_description_says() -> None:
    """Pitched down by 0.35 rad, upright, the right eye on its right; and a URDF's optical link."""
    frames = rover_frames(RoverSpec(model="prospector"))
    right, down, ahead = frames.T_body_camera.rotation.T
    np.testing.assert_allclose(ahead, [np.cos(0.35), 0.0, -np.sin(0.35)], atol=1e-12)
    np.testing.assert_allclose(right, [0.0, -1.0, 0.0], atol=1e-12)
    assert down[2] < 0
    assert frames.T_body_camera_right is not None
    apart = frames.T_body_camera.inverse() @ frames.T_body_camera_right
    np.testing.assert_allclose(apart.translation, [0.4, 0.0, 0.0], atol=1e-12)
    scout = rover_frames(RoverSpec(model="scout"))
    dip = np.radians(20.0)
    looks = scout.T_body_camera.rotation[:, 2]
    np.testing.assert_allclose(looks, [np.cos(dip), 0.0, -np.sin(dip)], atol=1e-9)
    np.testing.assert_allclose(scout.T_body_camera.translation, [0.24, 0.075, 0.72], atol=1e-9)
    assert scout.T_body_camera_right is None


def _with_meshes(folder: Path) -> str:
    """Write the scout with a mesh for its body, by the name that ROS has for it."""
    corners = np.array([(x, y, z) for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (-0.1, 0.1)])
    (folder / "meshes").mkdir()
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    faces = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    lines += [f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in faces]
    (folder / "meshes" / "hull.obj").write_text("\n".join(lines))
    path = changed(folder, "scout")
    text = (folder / "scout.urdf").read_text()
    box = '<geometry><box size="0.60 0.42 0.16"/></geometry><material'
    mesh = '<geometry><mesh filename="package://scout/meshes/hull.obj"/></geometry><material'
    (folder / "scout.urdf").write_text(text.replace(box, mesh))
    return path


def test_meshes_are_found_beside_the_urdf_and_drawn(tmp_path: Path) -> None:
    """A ``package://`` name, looked for from the URDF's folder on; the drawing has its corners."""
    spec = RoverSpec(model=_with_meshes(tmp_path))
    drawing = rover_drawing(spec)
    (base,) = (link for link in drawing.links if link.name == "own/base_link")
    corners = np.concatenate([mesh.vertices for mesh in base.meshes])
    low, high = corners.min(axis=0), corners.max(axis=0)
    np.testing.assert_allclose([*low, *high], [-0.3, -0.2, -0.08, 0.3, 0.2, 0.12], atol=1e-6)
    assert build_scene(Waves(), spec).frames.mass_kg == pytest.approx(40.0)


def test_urdf_shapes_are_drawn_in_their_colours() -> None:
    """Visual shapes, not the collision ones; yellow, and dark wheels."""
    links = {link.name: link for link in rover_drawing(RoverSpec(model="scout")).links}
    assert len(links["own/base_link"].meshes) == 2
    np.testing.assert_allclose(links["own/base_link"].meshes[0].rgba, [0.9, 0.7, 0.15, 1])
    assert len(links["own/front_left_wheel"].meshes) == 3
    assert not links["own/imu_link"].meshes


def test_wheels_of_unequal_size_are_refused(tmp_path: Path) -> None:
    """With the sizes found; one size for all is taken where the description gives it."""
    path = Path(changed(tmp_path, "scout"))
    urdf = (tmp_path / "scout.urdf").read_text()
    (tmp_path / "scout.urdf").write_text(urdf.replace('radius="0.13"', 'radius="0.15"', 2))
    with pytest.raises(SpecError, match=r"differ in radius \(front_left 0.15 m, front_right 0.13"):
        bare_model(str(path))
    told = changed(tmp_path, "scout", wheel_radius_m=0.14, wheel_width_m=0.09)
    told = str(Path(told).rename(tmp_path / "told.yaml"))
    frames = rover_frames(RoverSpec(model=told))
    assert (frames.wheel_radius_m, frames.wheel_width_m) == (0.14, pytest.approx(0.09))


def test_the_footprint_for_planning_is_that_of_our_own_rover_for_our_own_rover() -> None:
    """The defaults of the spec, and what they come to for the others."""
    of = {name: RoverSpec(model=name) for name in model_names()}
    found = {n: MobilitySpec.of_rover(rover_frames(s), belly_height_m(s)) for n, s in of.items()}
    default = MobilitySpec()
    for field in ("front_m", "rear_m", "half_width_m", "wheel_width_m", "belly_height_m"):
        assert getattr(found["exomars"], field) == pytest.approx(getattr(default, field))
    assert found["exomars"].straddle_width_m == pytest.approx(default.straddle_width_m)
    assert found["prospector"].front_m == pytest.approx(0.85)
    assert found["scout"].half_width_m == pytest.approx(0.32)
    assert belly_height_m(of["prospector"]) == pytest.approx(0.51)


def test_a_suspension_of_slides_is_refused(tmp_path: Path) -> None:
    """The drawing and the truth have hinges only; the joint is named."""
    path = changed(tmp_path, "prospector")
    text = (tmp_path / "prospector.xml").read_text()
    text = text.replace('name="rocker_l" axis', 'name="rocker_l" type="slide" axis')
    (tmp_path / "prospector.xml").write_text(text)
    with pytest.raises(SpecError, match=r"'rocker_l' \(suspension\) is no hinge"):
        rover_frames(RoverSpec(model=path))


def test_the_differential_ties_the_rockers() -> None:
    """One equality of joints; the sense follows from the axes, which differ in the model."""
    model = bare_model("prospector")
    assert model.neq == 1
    assert int(model.eq_type[0]) == int(mujoco.mjtEq.mjEQ_JOINT)
    assert model.eq_data[0, 1] == 1.0


def test_a_models_own_settings_do_not_reach_the_physics(tmp_path: Path) -> None:
    """Solver, step, sizes, looks and units are the user's own affair; LPET's are measured."""
    path = changed(tmp_path, "prospector")
    text = (tmp_path / "prospector.xml").read_text()
    settings = """<option timestep="0.001" solver="CG" density="1.2" wind="1 0 0" gravity="0 0 1">
      <flag gravity="disable" contact="disable"/></option>
      <size memory="10M" nuserdata="3" nuser_body="2"/>
      <visual><map znear="0.3"/><headlight ambient="1 1 1"/></visual>
      <statistic extent="3" meansize="0.2"/><default>"""
    (tmp_path / "prospector.xml").write_text(text.replace("<default>", settings, 1))
    mine, ours = bare_model(path), bare_model("prospector")
    for name in ("timestep", "solver", "density", "disableflags", "gravity", "wind", "impratio"):
        np.testing.assert_array_equal(getattr(mine.opt, name), getattr(ours.opt, name))
    np.testing.assert_array_equal(mine.body_mass, ours.body_mass)


def test_joints_that_are_not_named_are_held_where_they_are(tmp_path: Path) -> None:
    """Rockers that no one names are rigid, and the model's own tie of them goes with them."""
    path = changed(tmp_path, "prospector", suspension=[], differentials=[])
    text = (tmp_path / "prospector.xml").read_text()
    tie = '<equality><joint joint1="rocker_l" joint2="rocker_r"/></equality></mujoco>'
    (tmp_path / "prospector.xml").write_text(text.replace("</mujoco>", tie))
    model = bare_model(path)
    assert (model.njnt, model.neq) == (1 + 4 + 4, 0)
    assert rover_frames(RoverSpec(model=path)).suspension_joints == ()
