"""The nodes of the cell as processes, and the services and topics that the demo uses."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import rclpy
from paint_msgs.msg import ThicknessStats
from paint_msgs.srv import RecommendIndex, SaveFilm
from rclpy.client import Client
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger
from tqdm import tqdm

DEADLINE_S = 90.0
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Cell:
    """Starts nodes and, at the end, stops those that still run."""

    def __init__(self, prefix: Path) -> None:
        self._prefix = prefix
        self._processes: dict[str, subprocess.Popen] = {}
        self._clients: dict[str, Client] = {}
        self._node = Node('demo')

    def __enter__(self) -> 'Cell':
        return self

    def __exit__(self, *error: object) -> None:
        for process in self._processes.values():
            process.send_signal(signal.SIGINT)
        for process in self._processes.values():
            process.wait(timeout=20)
        self._node.destroy_node()

    def start(self, name: str, **parameters: object) -> None:
        """Start a node as `ros2 run` would."""
        command = [str(self._prefix / name), '--ros-args', '--log-level', 'warn']
        for key, value in parameters.items():
            command += ['-p', f'{key}:={value}']
        self._processes[name] = subprocess.Popen(command)

    def wait_for_service(self, kind: type, name: str) -> None:
        """Wait until a node offers a service, which it does when it is ready."""
        self._clients[name] = self._node.create_client(kind, name)
        self._until(self._clients[name].service_is_ready, f'the service {name}')

    def follow_poses(self, total: int) -> ThicknessStats:
        """Show how the poses arrive; returns the last statistics."""
        newest: list[ThicknessStats] = []
        self._node.create_subscription(ThicknessStats, 'thickness/stats', newest.append, LATCHED)
        with tqdm(total=total, desc='painting', unit='pose') as bar:

            def arrived() -> bool:
                seen = newest[-1].poses_received if newest else 0
                if seen > bar.n:
                    bar.update(seen - bar.n)
                return seen >= total

            self._until(arrived, f'{total} poses')
        return newest[-1]

    def wait_for_end(self, name: str) -> None:
        """Wait until a node ends on its own."""
        process = self._processes.pop(name)
        if process.wait(timeout=DEADLINE_S):
            sys.exit(f'demo: {name} ended with exit code {process.returncode}')

    def save_film(self, name: str) -> list[Path]:
        """Have the simulator write the film; returns the files."""
        answer = self._call(
            SaveFilm, 'deposition_simulator/save_film', SaveFilm.Request(name=name)
        )
        if not answer.success:
            sys.exit(f'demo: {answer.message}')
        return [Path(path) for path in answer.paths]

    def stop_recorder(self) -> Path:
        """Have the recorder finish its file; returns the run's folder."""
        answer = self._call(Trigger, 'run_recorder/stop', Trigger.Request())
        if not answer.success:
            sys.exit(f'demo: {answer.message}')
        print(answer.message)
        self.wait_for_end('run_recorder')
        return Path(answer.message.rsplit(': ', 1)[-1])

    def recommend_index(self, **fields: float) -> RecommendIndex.Response:
        """Ask the planner."""
        request = RecommendIndex.Request(**fields)
        return self._call(RecommendIndex, 'recommend_index', request)

    def _call(self, kind: type, name: str, request: object):
        if name not in self._clients:
            self.wait_for_service(kind, name)
        future = self._clients[name].call_async(request)
        self._until(future.done, f'an answer of {name}')
        return future.result()

    def _until(self, done, what: str) -> None:
        end = time.monotonic() + DEADLINE_S
        while not done():
            for name, process in self._processes.items():
                if process.poll():
                    sys.exit(f'demo: {name} ended with exit code {process.returncode}')
            if time.monotonic() > end:
                sys.exit(f'demo: waited {DEADLINE_S:.0f} s for {what}')
            rclpy.spin_once(self._node, timeout_sec=0.1)
