"""A test of a robot's control settings, for the repository of the robot's program: run it with pytest.

The settings are in a YAML file beside that program, as `rmrc tune` prints them. The test moves the arm along
its everyday path, and checks limits that must always hold. It needs no robot.
"""

import numpy as np

import rmrc

SETTINGS = {
    "period": 0.002,
    "feedback": 10.0,
    "inverse": {"damping": {"maximum": 0.05, "below": 0.1}},
    "limits": {"rate": 2.0, "acceleration": 8.0, "jerk": 400.0},
}  # in real life: SETTINGS = "robot/control.yaml"


def drive(control: object, ticks: int = 1500) -> tuple[np.ndarray, np.ndarray]:
    """Move the hand through the wrist's singularity on an ideal arm; return rates (T, 6) and errors [m]."""
    controller = rmrc.Controller("ur5e", control=control)  # type: ignore[arg-type]
    q = np.array([0.0, -1.5, 1.8, -1.9, -0.3, 0.0])
    controller.reset(q)
    start, goal = controller.arm.pose(q), controller.arm.pose(q + np.array([0, 0, 0, 0, 0.6, 0]))
    rates, errors = [], []
    for tick in range(ticks):
        share = min(1.0, tick / 1000)
        pose = start + (1 - np.cos(np.pi * share)) / 2 * (goal - start)
        out = controller.step(q, pose=pose)
        rates.append(out.qdot_cmd.copy())
        errors.append(np.linalg.norm(out.pose_error[:3]))
        q = q + controller.period * out.qdot_cmd
    return np.array(rates), np.array(errors)


def test_the_commands_keep_to_what_the_robot_accepts() -> None:
    """Rates, accelerations and jerks stay below the limits of the settings, everywhere on the path."""
    rates, _ = drive(SETTINGS)
    for bound in (2.0, 8.0, 400.0):
        assert np.abs(rates).max() <= bound * (1 + 1e-6)
        rates = np.diff(rates, axis=0) / 0.002


def test_the_hand_gets_where_it_should() -> None:
    """At the end of the path the error is below a millimeter."""
    assert drive(SETTINGS)[1][-1] < 1e-3


def test_a_feedback_that_is_too_timid_is_seen() -> None:
    """The negative control: settings that must fail."""
    assert drive({**SETTINGS, "feedback": 0.5})[1][-1] > 1e-3


if __name__ == "__main__":
    for name, test in list(globals().items()):
        if name.startswith("test_"):
            test()
            print(f"passed: {name}")
