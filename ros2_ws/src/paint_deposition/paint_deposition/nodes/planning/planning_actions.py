"""The planner's long work: passes on a part, and the diagnosis of a campaign."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from paint_msgs.action import Diagnose, PlanPasses

from paint_deposition.errors import PaintError
from paint_deposition.nodes.planning.diagnosing import Task, diagnosed
from paint_deposition.nodes.runtime.file_names import require_file_name
from paint_deposition.nodes.runtime.long_work import LongWork, Tell

if TYPE_CHECKING:
    from paint_deposition.nodes.planning.index_planner import IndexPlanner


class PlanningActions:
    """Offers the actions `plan_passes` and `diagnose`."""

    def __init__(self, node: IndexPlanner) -> None:
        self._node = node
        self._actions = [
            LongWork(node, PlanPasses, 'plan_passes', self._plan_passes),
            LongWork(node, Diagnose, 'diagnose', self._diagnose),
        ]

    def close(self) -> None:
        """Break off what is being done."""
        for action in self._actions:
            action.close()

    def _plan_passes(self, goal: PlanPasses.Goal, tell: Tell) -> PlanPasses.Result:
        asked = {
            'mesh_file': os.path.expanduser(goal.mesh_file),
            'speed_m_per_s': goal.speed_m_per_s,
            'target_um': goal.target_um,
            'index_m': goal.index_m,
            'direction': goal.direction,
        }
        given = {name: value for name, value in asked.items() if value}
        if 'target_um' in given and 'speed_m_per_s' not in given:
            given['speed_m_per_s'] = 0.0  # the target chooses it, not the parameter
        planned, path = self._node.plan_and_show(given, tell)
        return PlanPasses.Result(
            success=True,
            message=planned.sentence,
            path=path,
            passes=len(planned.passes),
            index_m=planned.placing.index_m,
            speed_m_per_s=planned.style.speed_m_per_s,
            duration_s=planned.cycle_time_s,
            mean_um=planned.mean_um,
            sigma_n=planned.sigma_n,
        )

    def _diagnose(self, goal: Diagnose.Goal, tell: Tell) -> Diagnose.Result:
        values = self._node.values
        require_file_name('name', goal.name)
        folder = Path(values['output_directory']).expanduser().absolute() / goal.name
        if folder.exists():
            raise PaintError(f'{folder} is there already: choose another name')
        task = Task(
            os.path.expanduser(goal.campaign_file),
            os.path.expanduser(goal.model_file),
            folder,
            values['allow_user_effects'],
        )
        return Diagnose.Result(success=True, **diagnosed(task, tell))
