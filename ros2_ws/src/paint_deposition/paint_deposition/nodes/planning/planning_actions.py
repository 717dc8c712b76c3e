"""The planner's long work: passes on a part, and the diagnosis of a campaign."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from paint_msgs.action import Diagnose, PlanPasses

from paint_deposition.errors import PaintError
from paint_deposition.files.model_file import read_model_file
from paint_deposition.nodes.runtime.file_names import require_file_name
from paint_deposition.nodes.runtime.long_work import LongWork, Tell
from paint_deposition.nodes.runtime.model_parameters import effect_loader

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
        # Pictures and fits take seconds to load, which a node that only plans need not wait for.
        from paint_deposition.api.inference import diagnose
        from paint_deposition.api.writing import write
        from paint_deposition.files.campaign_file import read_campaign

        values = self._node.values
        require_file_name('name', goal.name)
        folder = Path(values['output_directory']).expanduser().absolute() / goal.name
        if folder.exists():
            raise PaintError(f'{folder} is there already: choose another name')
        line = _by_line(tell)
        campaign = read_campaign(os.path.expanduser(goal.campaign_file), line)
        chosen = os.path.expanduser(goal.model_file) or campaign.model_file
        # Read here, where it is known whether the code of its effect files may run.
        start = read_model_file(chosen, effect_loader(values)) if chosen else None
        found = diagnose(
            replace(campaign, model_file=None),
            start.model if start else None,
            posterior=start.posterior if start else None,
            progress=line,
        )
        tell('writing', 0.0)
        files = write(found, folder, start=start)
        before, after = found.history[0], found.history[-1]
        return Diagnose.Result(
            success=True,
            message=found.reason,
            verdict=found.verdict,
            p_value=float(found.p_value),
            accepted=list(found.accepted),
            rmse_before_um=float(before.rmse_um),
            rmse_after_um=float(after.rmse_um),
            paths=[str(file) for file in files],
        )


def _by_line(tell: Tell) -> Callable[[str], None]:
    """Progress of which only what is being done is known."""
    return lambda line: tell(line, 0.0)
