"""Nodes as processes of their own, for what only a process shows: signals and exit codes."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from nodes.cell import write_panel


def recorder_process(folder: Path, **parameters: object) -> 'NodeProcess':
    """A recorder of the run `run` in this folder."""
    chosen = {'output_directory': folder, 'name': 'run'} | parameters
    return NodeProcess(folder / 'recorder', 'run_recorder', **chosen)


def simulator_process(folder: Path, **parameters: object) -> 'NodeProcess':
    """A simulator of the panel."""
    mesh = write_panel(folder / 'panel.stl')
    return NodeProcess(folder / 'simulator', 'deposition_simulator', mesh_file=mesh, **parameters)


class NodeProcess(subprocess.Popen):
    """An executable that writes `<log>.out` and `<log>.err`, and is killed when a `with` ends."""

    def __init__(
        self,
        log: Path,
        executable: str,
        *,
        code: str = '',
        ros_arguments: tuple[str, ...] = (),
        **parameters: object,
    ) -> None:
        self._log = log
        program = code or (
            f'import sys; from paint_deposition.nodes.executables import {executable}; '
            f'sys.exit({executable}())'
        )
        arguments = [
            part
            for name, value in parameters.items()
            for part in ('-p', f'{name}:={str(value).lower() if value is True else value}')
        ]
        with log.with_suffix('.out').open('wb') as out, log.with_suffix('.err').open('wb') as err:
            super().__init__(
                [sys.executable, '-c', program, '--ros-args', *arguments, *ros_arguments],
                stdout=out, stderr=err, cwd=log.parent,
                env=os.environ | {'PYTHONUNBUFFERED': '1'},
            )  # fmt: skip

    @property
    def out(self) -> str:
        return self._log.with_suffix('.out').read_text()

    @property
    def err(self) -> str:
        return self._log.with_suffix('.err').read_text()

    def wait(self, timeout: float | None = 60.0) -> int:
        return super().wait(timeout)

    def interrupt_as_launch_does(self) -> None:
        """Ctrl-C under `ros2 launch`: one SIGINT from the terminal, and one from launch."""
        self.send_signal(signal.SIGINT)
        self.send_signal(signal.SIGINT)

    def stall(self) -> None:
        """Stop the process where it is, as a debugger or a lack of memory does."""
        self.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        super().kill()
        self.wait()

    def __exit__(self, *_: object) -> None:
        if self.poll() is None:
            self.kill()
