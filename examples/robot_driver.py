"""Drive a robot over a socket at 500 Hz: a simulated one on 127.0.0.1 that responds late and loses packets.

The robot sends a numbered state every 2 ms. The program responds to each with joint rates. Without a new
state the watchdog brakes: `command_at` gives the commands to send meanwhile.
"""

import socket
import struct
import threading
from collections import deque

import numpy as np

import rmrc

PERIOD, TICKS, LATE, LOST = 0.002, 1500, 4, range(200, 300)  # s; of the way there, in ticks; a gap of 0.2 s
JOINTS = 6
STATE, RATES = struct.Struct(f"<q{JOINTS}d"), struct.Struct(f"<{JOINTS}d")


def fake_robot(port: socket.socket, q: np.ndarray) -> None:
    """Send states and obey rates, which arrive some ticks later; ticks of LOST send nothing."""
    port.settimeout(1.0)
    _, driver = port.recvfrom(64)  # the sender of the first packet is the driver
    way = deque([np.zeros(JOINTS)] * LATE)
    for tick in range(TICKS):
        port.sendto(STATE.pack(-1 if tick in LOST else tick, *q), driver)
        way.append(np.array(RATES.unpack(port.recv(64))))
        q = q + PERIOD * way.popleft()
    port.sendto(STATE.pack(TICKS, *q), driver)


# The clock is the robot's: a slow program gives the same result.
now = 0.0
control = {"feedback": 8.0, "limits": {"rate": 1.0, "acceleration": 4.0, "jerk": 80.0}}
controller = rmrc.Controller(
    "ur5e", control=control, period=PERIOD, actuators=False,  # the robot takes rates
    watchdog=5 * PERIOD, clock=lambda: now,
)  # fmt: skip
start = controller.arm.configuration("home")[controller.arm.wiring.qpos]
goal = controller.arm.pose(start) + np.array([-0.1, 0.15, -0.1, 0, 0, 0, 0])
controller.reset(start)
controller.warm_up()  # before the robot waits for an answer

robot = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
robot.bind(("127.0.0.1", 0))
thread = threading.Thread(target=fake_robot, args=(robot, start))
thread.start()
driver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
driver.settimeout(1.0)
driver.connect(robot.getsockname())
driver.send(b"hello")
sent = [np.zeros(JOINTS)]
for tick in range(TICKS + 1):
    count, *q = STATE.unpack(driver.recv(64))
    now = tick * PERIOD
    if count == TICKS:
        break
    # without a new state, the last command holds for the watchdog's time, and then brakes
    out = controller.command_at() if count < 0 else controller.step(q, pose=goal)
    sent.append(out.qdot_cmd.copy())
    driver.send(RATES.pack(*out.qdot_cmd))
thread.join()
robot.close()
driver.close()

rates = np.array(sent)
acceleration = np.abs(np.diff(rates, axis=0)).max() / PERIOD
before, behind = (np.abs(rates[tick]).max() for tick in (LOST.start, LOST.stop))
error = np.linalg.norm(goal[:3] - controller.arm.pose(np.array(q))[:3])
print(f"{len(rates) - 1} commands at 500 Hz")
print(f"{len(LOST)} states lost: braked from {before:.2f} to {behind:.2f} rad/s")
print(f"largest acceleration {acceleration:.2f} of 4 rad/s²; at the goal within {1e3 * error:.1f} mm")
