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


class NodeProcess:
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
        self._out, self._err = log.with_suffix('.out'), log.with_suffix('.err')
        program = code or (
            f'import sys; from paint_deposition.nodes.executables import {executable}; '
            f'sys.exit({executable}())'
        )
        arguments = [
            part
            for name, value in parameters.items()
            for part in ('-p', f'{name}:={str(value).lower() if value is True else value}')
        ]
        with self._out.open('wb') as out, self._err.open('wb') as err:
            self._process = subprocess.Popen(
                [sys.executable, '-c', program, '--ros-args', *arguments, *ros_arguments],
                stdout=out,
                stderr=err,
                env=os.environ | {'PYTHONUNBUFFERED': '1'},
                cwd=log.parent,
            )

    @property
    def out(self) -> str:
        return self._out.read_text()

    @property
    def err(self) -> str:
        return self._err.read_text()

    @property
    def exit_code(self) -> int | None:
        return self._process.poll()

    def wait(self, timeout_s: float = 60.0) -> int:
        return self._process.wait(timeout_s)

    def interrupt_as_launch_does(self) -> None:
        """Ctrl-C under `ros2 launch`: one SIGINT from the terminal, and one from launch."""
        self._process.send_signal(signal.SIGINT)
        self._process.send_signal(signal.SIGINT)

    def terminate(self) -> None:
        self._process.terminate()

    def stall(self) -> None:
        """Stop the process where it is, as a debugger or a lack of memory does."""
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self._process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def __enter__(self) -> 'NodeProcess':
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self.kill()
