# SPDX-License-Identifier: Apache-2.0
"""scripts/bounds.py on scenes whose bounds are known: numeric Jacobians, a wall, a corner of a room."""
import pathlib
import sys

try:
    import numpy as np
    import PIL  # noqa: F401
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(0)
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "scripts"))
import bounds  # noqa: E402

CAMERA = {"fx": 262.5, "fy": 262.5, "cx": 159.5, "cy": 119.5}
SIZE = (240, 320)


def rays():
    v, u = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]), indexing="ij")
    return np.stack([(u - CAMERA["cx"]) / CAMERA["fx"], (v - CAMERA["cy"]) / CAMERA["fy"], np.ones(SIZE)], 2)


def depth_of(planes):
    """Of planes theta . point = 1, the nearest along each ray."""
    inverse = np.max([rays() @ theta for theta in planes], axis=0)
    return 1 / inverse


def turned(points, step):
    """`points` in the axes of a camera that was moved by step = [translation, rotation]."""
    return points + step[:3] + np.cross(step[3:], points)


def rays_at(uv):
    return np.column_stack([(uv[:, 0] - CAMERA["cx"]) / CAMERA["fx"], (uv[:, 1] - CAMERA["cy"]) / CAMERA["fy"],
                            np.ones(len(uv))])


def residuals(points, uv, depth, corner):
    z = points[:, 2]
    u = CAMERA["fx"] * points[:, 0] / z + CAMERA["cx"]
    v = CAMERA["fy"] * points[:, 1] / z + CAMERA["cy"]
    sigma = bounds.depth_sigma(depth)
    return np.concatenate([(u - uv[:, 0]) / corner, (v - uv[:, 1]) / corner, (z - depth) / sigma])


def numeric_jacobian(uv, depth, h=1e-6):
    points = depth[:, None] * rays_at(uv)
    return np.column_stack([(residuals(turned(points, h * e), uv, depth, 0.4) -
                             residuals(turned(points, -h * e), uv, depth, 0.4)) / (2 * h) for e in np.eye(6)])


def test_information_of_points_is_that_of_numeric_jacobians():
    rng = np.random.default_rng(1)
    uv = rng.uniform((10, 10), (310, 230), (7, 2))
    depth = rng.uniform(0.8, 4, 7)
    jacobian = numeric_jacobian(uv, depth)
    ours = bounds.point_information(uv, depth, CAMERA, 0.4)
    assert np.allclose(ours, jacobian.T @ jacobian, rtol=1e-5, atol=1e-6 * np.abs(ours).max())


def test_a_wall_alone_leaves_three_directions_open():
    depth = depth_of([np.array([0, 0, 0.5])])
    points, normals = bounds.flat_surfaces(depth, np.ones(SIZE, bool), CAMERA)
    assert len(points) == (SIZE[0] // bounds.STEP) * (SIZE[1] // bounds.STEP)
    assert np.allclose(np.abs(normals), [0, 0, 1], atol=1e-9) and np.allclose(points[:, 2], 2)
    information = bounds.plane_information(points, normals)
    assert bounds.bound(information) is None
    # Along the wall's normal every pixel is a measurement of the same distance.
    expected = SIZE[0] * SIZE[1] / bounds.depth_sigma(np.array(2.0)) ** 2
    assert np.isclose(information[2, 2], expected, rtol=1e-9)
    assert np.allclose(information[[0, 1, 5], [0, 1, 5]], 0)


def test_a_corner_of_three_walls_fixes_the_camera():
    planes = [np.array([0, 0, 1 / 3]), np.array([1 / 1.0, 0, 0.05]), np.array([0, 1 / 0.9, 0.05])]
    points, normals = bounds.flat_surfaces(depth_of(planes), np.ones(SIZE, bool), CAMERA)
    kinds = {tuple(np.round(np.abs(n), 2)) for n in normals}
    assert len(kinds) == 3, kinds
    place, turn = bounds.bound(bounds.plane_information(points, normals))
    assert 0 < place < 1e-3 and 0 < turn < 1e-3


def test_the_bound_is_the_spread_of_the_best_estimate():
    rng = np.random.default_rng(2)
    uv = rng.uniform((10, 10), (310, 230), (60, 2))
    depth = rng.uniform(0.8, 3, 60)
    jacobian = numeric_jacobian(uv, depth)
    noise = rng.standard_normal((jacobian.shape[0], 2000))
    steps = np.linalg.lstsq(jacobian, noise, rcond=None)[0]
    place, turn = bounds.bound(bounds.point_information(uv, depth, CAMERA, 0.4))
    assert np.isclose(np.sqrt((steps[:3] ** 2).sum(0).mean()), place, rtol=0.05)
    assert np.isclose(np.sqrt((steps[3:] ** 2).sum(0).mean()), turn, rtol=0.05)


def test_the_error_is_what_remains_after_alignment():
    rng = np.random.default_rng(3)
    truth = np.column_stack([np.arange(50) / 10, rng.uniform(-1, 1, (50, 3))])
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    estimate = truth.copy()
    estimate[:, 1:] = truth[:, 1:] @ turn.T + [1, 2, 3]
    error, poses = bounds.position_error(truth, estimate[::2])
    assert poses == 25 and error < 1e-12
    estimate[:, 1:] += 0.01 * rng.standard_normal((50, 3))
    error, poses = bounds.position_error(truth, estimate)
    assert poses == 50 and 0.013 < error < 0.021


def main():
    tests = [(name, f) for name, f in sorted(globals().items()) if name.startswith("test_")]
    for name, test in tests:
        test()
        print(f"{name}: passed")
    print(f"{len(tests)} tests passed")


if __name__ == "__main__":
    main()
