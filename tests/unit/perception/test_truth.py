"""What is seen against what is there: recall, false cells, clearing, shadows, a missing camera, all with the cameras' noise."""

from __future__ import annotations

import numpy as np
import pytest

from common.geometry.transforms import rpy_matrix
from common.robot.payload import Payload, payload_body, with_payload
from services.perception.core.background import lowest_visible_m
from services.robot_sim.core.camera_shapes import PlacedShape
from tests.support.eyes import Eyes
from tests.support.truth import signed_distance_m

ASIDE = np.array([-2.5, -1.5708, 1.5708, -1.5708, -1.5708, 0.0])  # the arm looks the other way
TWO_CELLS_M = 0.04


def at(x: float, y: float, z: float, rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    return rpy_matrix([x, y, z], rpy)


def hand(x: float) -> list[PlacedShape]:
    """A forearm with a hand that reaches in along x."""
    return [
        PlacedShape("capsule", (0.04, 0.3), at(x, 0.3, 0.35, (0.0, np.pi / 2, 0.0))),
        PlacedShape("box", (0.12, 0.09, 0.04), at(x - 0.22, 0.3, 0.35)),
    ]


THINGS = [
    PlacedShape("box", (0.1, 0.12, 0.2), at(0.45, 0.0, 0.1)),
    PlacedShape("sphere", (0.06,), at(0.1, 0.5, 0.3)),
    PlacedShape("cylinder", (0.05, 0.2), at(0.5, 0.55, 0.12)),
    PlacedShape("capsule", (0.04, 0.3), at(0.1, -0.55, 0.4, (1.2, 0.3, 0.4))),
]


@pytest.fixture(scope="module")
def shared() -> Eyes:
    return Eyes()


@pytest.fixture
def eyes(shared: Eyes) -> Eyes:
    shared.forget()
    return shared


def distance_m(eyes: Eyes, cells: np.ndarray, shapes: list[PlacedShape]) -> np.ndarray:
    """(C,) distance of cell centres to the nearest true surface."""
    centres = eyes.grid.centres(cells)
    return np.min([np.abs(signed_distance_m(s, centres)) for s in shapes], axis=0)


def surface_cells(eyes: Eyes, shape: PlacedShape) -> np.ndarray:
    """Cells whose centre is within half a cell of the surface and high enough above the table to be seen; shapes of up to 0.5 m."""
    i, j, k = (np.arange(*np.clip(np.round((c - o) / eyes.grid.resolution_m + [-13, 13]).astype(int), 0, n)) for c, o, n in
               zip(shape.T_world_shape[:3, 3], eyes.grid.origin_m, eyes.grid.shape, strict=True))  # fmt: skip
    _, ny, nz = eyes.grid.shape
    around = ((i[:, None, None] * ny + j[:, None]) * nz + k).ravel()
    centres = eyes.grid.centres(around)
    return around[(np.abs(signed_distance_m(shape, centres)) < 0.0101) & (centres[:, 2] > 0.03)]


def test_things_are_seen_at_once_and_nothing_else_is(eyes: Eyes) -> None:
    for k in range(40):
        cells = eyes.look(ASIDE, THINGS)
        hits = np.setdiff1d(cells, eyes.shadow_cells)
        assert distance_m(eyes, hits, THINGS).max() < TWO_CELLS_M, f"false cell in frame {k}"
        for thing in THINGS:
            seen = np.isin(surface_cells(eyes, thing), cells).mean()
            assert seen > (0.8 if k == 0 else 0.85), f"{thing.shape} in frame {k}: {seen:.2f} of its surface"


def test_an_empty_table_stays_empty(eyes: Eyes) -> None:
    """Table, bins and arm, each with noise: not one cell in a hundred frames."""
    assert sum(len(eyes.look(ASIDE)) for _ in range(100)) == 0


def test_the_arm_at_full_speed_is_never_an_obstacle(eyes: Eyes) -> None:
    """Perception has the joint state of the exposure, as the service interpolates it."""
    speed = eyes.robot.max_velocity_rad_s
    rng = np.random.default_rng(0)
    q = eyes.robot.home_rad.copy()
    direction = rng.choice([-1.0, 1.0], len(q))
    for k in range(150):
        q = q + direction * speed / 15.0
        low, high = eyes.robot.position_min_rad, eyes.robot.position_max_rad
        direction[(q < low) | (q > high)] *= -1.0
        q = np.clip(q, low, high)
        assert len(eyes.look(q)) == 0, f"own body seen in frame {k} at {q}"
        assert eyes.occupancy.n_arm_points > 500, "the arm was not in view at all"


def test_a_stale_joint_state_would_be_seen(eyes: Eyes) -> None:
    """The test above can fail: with the joint state of one frame before, the arm is an obstacle."""
    q = eyes.robot.home_rad
    believed = q - 0.5 * eyes.robot.max_velocity_rad_s / 15.0 * np.array([1, 1, 1, 0, 0, 0])
    assert len(eyes.look(q, q_filter_rad=believed)) > 0


def test_a_removed_thing_clears_within_half_a_second(eyes: Eyes) -> None:
    for _ in range(10):
        assert len(eyes.look(ASIDE, THINGS)) > 100
    for _ in range(7):  # 0.47 s at 15 Hz
        cells = eyes.look(ASIDE)
    assert len(cells) == 0


def test_clearing_needs_no_background(eyes: Eyes) -> None:
    """Above the rim of the table, against nothing at all: no camera gets a return there once the thing is gone."""
    bare = Eyes(["static=[]"])
    thing = [PlacedShape("sphere", (0.08,), at(0.3, 0.0, 0.75))]
    for _ in range(5):
        assert len(bare.look(ASIDE, thing)) > 50
    for _ in range(7):
        cells = bare.look(ASIDE)
    assert len(cells) == 0


def test_a_hidden_cell_does_not_age_and_clears_when_it_is_seen_again(eyes: Eyes) -> None:
    """A big screen before all cameras hides the ball; the ball is remembered until the screen is gone and the place is seen empty."""
    ball = [PlacedShape("sphere", (0.05,), at(0.35, 0.0, 0.3))]
    screen = [PlacedShape("box", (0.3, 0.3, 0.3), at(0.35, 0.0, 0.3))]
    before = eyes.look(ASIDE, ball)
    core = before[signed_distance_m(ball[0], eyes.grid.centres(before)) < 0.02]
    for _ in range(45):
        cells = eyes.look(ASIDE, screen)
    assert np.isin(core, cells).all()
    for _ in range(7):
        cells = eyes.look(ASIDE)
    assert len(cells) == 0


def test_a_moving_hand_is_followed(eyes: Eyes) -> None:
    for k in range(40):
        shapes = hand(0.9 - 0.25 * k / 15.0)
        cells = eyes.look(ASIDE, shapes)
        hits = np.setdiff1d(cells, eyes.shadow_cells)
        # what it left is cleared within two to six frames: at 0.25 m/s up to 10 cm behind, never anywhere else
        assert distance_m(eyes, hits, [*shapes, *hand(0.9 - 0.25 * (k - 3) / 15.0), *hand(0.9 - 0.25 * (k - 6) / 15.0)]).max() < TWO_CELLS_M
        fresh = surface_cells(eyes, shapes[1])
        assert not len(fresh) or np.isin(fresh, cells).mean() > 0.8


def test_a_missing_camera_costs_little(eyes: Eyes) -> None:
    for missing in range(4):
        eyes.forget()
        for _ in range(3):
            cells = eyes.look(ASIDE, THINGS, missing=[missing])
        for thing in THINGS:
            assert np.isin(surface_cells(eyes, thing), cells).mean() > 0.75


def test_one_camera_casts_a_shallow_shadow_that_another_dissolves(eyes: Eyes) -> None:
    plate = [PlacedShape("box", (0.02, 0.25, 0.25), at(0.35, 0.0, 0.4, (0.0, 0.0, np.pi / 4)))]  # faces front_left
    normal = np.array([np.cos(np.pi / 4), np.sin(np.pi / 4), 0.0])
    alone = eyes.look(ASIDE, plate, missing=[1, 2, 3])
    offset = (eyes.grid.centres(alone) - [0.35, 0.0, 0.4]) @ normal
    assert (offset < -0.04).sum() > 100, "nothing behind the plate counts as occupied"
    assert offset.min() > -0.13, "the shadow is deeper than 10 cm"
    eyes.forget()
    together = eyes.look(ASIDE, plate)
    offset = (eyes.grid.centres(together) - [0.35, 0.0, 0.4]) @ normal
    assert (offset < -0.05).sum() == 0, "the camera behind the plate sees that there is nothing"


def test_there_is_no_shadow_where_the_arm_is(eyes: Eyes) -> None:
    """A hand close to the arm: its shadow does not reach into the arm, which would freeze it."""
    q = eyes.robot.home_rad
    poses = eyes.robot.joint_poses(q[None])[0]
    wrist = poses[5][:3, 3]
    shapes = [PlacedShape("box", (0.08, 0.08, 0.08), at(wrist[0] + 0.11, wrist[1] + 0.05, wrist[2] + 0.06))]
    cells = eyes.look(q, shapes)
    assert len(cells) > 20
    for body in eyes.robot.bodies:
        T = poses[body.joint]
        vertices = body.vertices @ T[:3, :3].T + T[:3, 3]
        gap = np.linalg.norm(eyes.grid.centres(cells)[:, None] - vertices[None], axis=2).min()
        assert gap > 0.01, f"a cell lies in {body.name}"


@pytest.mark.parametrize("place", [(0.0, -0.55), (0.5, 0.0), (0.6, 0.6)])
def test_the_lowest_thing_that_can_be_seen_is_what_is_stated(eyes: Eyes, place: tuple[float, float]) -> None:
    """A plate higher than the stated height (of the best camera) is seen, one of half the lowest is table."""
    x, y = place
    stated = []
    for m, e in zip(eyes.models, eyes.exposures(ASIDE, eyes.depth_images(ASIDE, [])), strict=True):
        optics = e.view.optics
        depth = float((m.T_camera_world @ [x, y, 0.0, 1.0])[2])
        v = (m.T_camera_world @ [x, y, 0.0, 1.0])[1] / depth * m.fy_px + m.cy_px
        if 0 <= v < m.height:
            stated.append(
                lowest_visible_m(m.T_world_camera[:3, 3], depth, np.array([x, y, 0.0]), optics.sigma_per_m2, 3.0, eyes.config.plane_sigmas)
            )
    lowest = min(stated)
    assert 0.005 < lowest < 0.030

    def seen(height_m: float) -> int:
        eyes.forget()
        return len(eyes.look(ASIDE, [PlacedShape("box", (0.1, 0.1, height_m), at(x, y, height_m / 2))]))

    assert seen(lowest + 0.004) > 5
    assert seen(lowest / 2 - 0.003) == 0


def test_what_the_gripper_holds_is_the_arm_and_no_cell() -> None:
    eyes = Eyes()
    q = eyes.robot.home_rad
    payload = Payload((0.08, 0.08, 0.12), (0.0, 0.0, 0.06))
    eyes.renderer.hold(payload_body(eyes.robot, payload))
    for _ in range(4):
        unknown = eyes.look(q)
    assert len(unknown) > 20  # nobody has told the eyes
    eyes.robot = with_payload(eyes.robot, payload)
    eyes.margin = np.append(eyes.margin, eyes.config.self_margin_m)
    eyes.occupancy.rearm(eyes.robot.grids)
    for _ in range(15):
        known = eyes.look(q)
    assert len(known) == 0
