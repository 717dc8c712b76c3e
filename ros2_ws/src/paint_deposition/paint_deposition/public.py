"""The public names: what a script or a notebook needs, and where each is defined.

Nothing is imported here but for type checkers: a script pays for the names that it uses.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from paint_deposition.api.geometry import GunOnPart, look_at
    from paint_deposition.api.improvement import improve
    from paint_deposition.api.inference import calibrate, compare, compare_models, diagnose, refit
    from paint_deposition.api.measuring import choose_readings
    from paint_deposition.api.pictures import plot
    from paint_deposition.api.planning import plan, plan_faces, recommend
    from paint_deposition.api.samples import sample_folder
    from paint_deposition.api.simulation import Film, simulate
    from paint_deposition.api.speeds import compare_speeds
    from paint_deposition.api.writing import write
    from paint_deposition.effects.deposition_model import DepositionModel
    from paint_deposition.errors import PaintError
    from paint_deposition.files.campaign_file import read_campaign
    from paint_deposition.files.gauge_readings import read_readings
    from paint_deposition.files.meshes import read_mesh
    from paint_deposition.files.model_file import read_model, write_model
    from paint_deposition.files.motion_files import read_recording
    from paint_deposition.inference.comparison.comparison import Comparison, SideBySide
    from paint_deposition.inference.diagnosis.reading_choice import ChosenReadings
    from paint_deposition.inference.diagnosis.verdict import Diagnosis
    from paint_deposition.inference.fitting.calibration import Calibration
    from paint_deposition.inference.readings.campaign import Campaign
    from paint_deposition.inference.readings.readings import Readings
    from paint_deposition.motion.driven_speed import DrivenSpeed
    from paint_deposition.motion.trajectory import Trajectory
    from paint_deposition.part.surface import Surface
    from paint_deposition.planning.clearance import GunEnvelope
    from paint_deposition.planning.improvement.improvement import Improvement
    from paint_deposition.planning.part_plan import PartPlan
    from paint_deposition.planning.plan import Plan
    from paint_deposition.planning.recommendation import Recommendation

# Name, and the module that defines it, within this package.
DEFINED_IN = {
    'Calibration': 'fitting.calibration',
    'Campaign': 'readings.campaign',
    'ChosenReadings': 'diagnosis.reading_choice',
    'Comparison': 'comparison.comparison',
    'DepositionModel': 'effects.deposition_model',
    'Diagnosis': 'diagnosis.verdict',
    'DrivenSpeed': 'motion.driven_speed',
    'Film': 'api.simulation',
    'GunEnvelope': 'planning.clearance',
    'GunOnPart': 'api.geometry',
    'Improvement': 'planning.improvement.improvement',
    'PaintError': 'errors',
    'PartPlan': 'planning.part_plan',
    'Plan': 'planning.plan',
    'Readings': 'readings.readings',
    'Recommendation': 'planning.recommendation',
    'SideBySide': 'comparison.comparison',
    'Surface': 'part.surface',
    'Trajectory': 'motion.trajectory',
    'calibrate': 'api.inference',
    'choose_readings': 'api.measuring',
    'compare': 'api.inference',
    'compare_models': 'api.inference',
    'compare_speeds': 'api.speeds',
    'diagnose': 'api.inference',
    'improve': 'api.improvement',
    'look_at': 'api.geometry',
    'plan': 'api.planning',
    'plan_faces': 'api.planning',
    'plot': 'api.pictures',
    'read_campaign': 'files.campaign_file',
    'read_mesh': 'files.meshes',
    'read_model': 'files.model_file',
    'read_readings': 'files.gauge_readings',
    'read_recording': 'files.motion_files',
    'recommend': 'api.planning',
    'refit': 'api.inference',
    'sample_folder': 'api.samples',
    'simulate': 'api.simulation',
    'write': 'api.writing',
    'write_model': 'files.model_file',
}

__all__ = [
    'Calibration',
    'Campaign',
    'ChosenReadings',
    'Comparison',
    'DepositionModel',
    'Diagnosis',
    'DrivenSpeed',
    'Film',
    'GunEnvelope',
    'GunOnPart',
    'Improvement',
    'PaintError',
    'PartPlan',
    'Plan',
    'Readings',
    'Recommendation',
    'SideBySide',
    'Surface',
    'Trajectory',
    'calibrate',
    'choose_readings',
    'compare',
    'compare_models',
    'compare_speeds',
    'diagnose',
    'improve',
    'look_at',
    'plan',
    'plan_faces',
    'plot',
    'read_campaign',
    'read_mesh',
    'read_model',
    'read_readings',
    'read_recording',
    'recommend',
    'refit',
    'sample_folder',
    'simulate',
    'write',
    'write_model',
]
