"""The public names: what a script or a notebook needs, and where each is defined."""

from paint_deposition.api.inference import (
    calibrate as calibrate,
)
from paint_deposition.api.inference import choose_readings as choose_readings
from paint_deposition.api.inference import (
    compare as compare,
)
from paint_deposition.api.inference import (
    compare_models as compare_models,
)
from paint_deposition.api.inference import (
    diagnose as diagnose,
)
from paint_deposition.api.inference import (
    refit as refit,
)
from paint_deposition.api.planning import (
    improve as improve,
)
from paint_deposition.api.planning import (
    plan as plan,
)
from paint_deposition.api.planning import (
    plan_faces as plan_faces,
)
from paint_deposition.api.planning import (
    recommend as recommend,
)
from paint_deposition.api.simulation import (
    look_at as look_at,
)
from paint_deposition.api.simulation import sample_folder as sample_folder
from paint_deposition.api.simulation import (
    simulate as simulate,
)
from paint_deposition.batch.sweep import Sweep as Sweep
from paint_deposition.batch.sweep import sweep as sweep
from paint_deposition.effects.deposition_model import DepositionModel as DepositionModel
from paint_deposition.errors import PaintError as PaintError
from paint_deposition.files.campaign_file import read_campaign as read_campaign
from paint_deposition.files.gauge_readings import read_readings as read_readings
from paint_deposition.files.meshes import read_mesh as read_mesh
from paint_deposition.files.model_file import read_model as read_model
from paint_deposition.files.model_file import write_model as write_model
from paint_deposition.files.motion_files import read_recording as read_recording
from paint_deposition.files.zones_file import read_zones as read_zones
from paint_deposition.film.film import Film as Film
from paint_deposition.film.film import GunOnPart as GunOnPart
from paint_deposition.inference.comparison.comparison import (
    Comparison as Comparison,
)
from paint_deposition.inference.comparison.comparison import (
    SideBySide as SideBySide,
)
from paint_deposition.inference.design.reading_choice import ChosenReadings as ChosenReadings
from paint_deposition.inference.diagnosis.verdict import Diagnosis as Diagnosis
from paint_deposition.inference.fitting.calibration import Calibration as Calibration
from paint_deposition.inference.readings.campaign import Campaign as Campaign
from paint_deposition.inference.readings.readings import Readings as Readings
from paint_deposition.motion.trajectory import Trajectory as Trajectory
from paint_deposition.part.surface import Surface as Surface
from paint_deposition.part.zones import Zones as Zones
from paint_deposition.planning.faces import PartPlan as PartPlan
from paint_deposition.planning.improvement import Improvement as Improvement
from paint_deposition.planning.plan import Plan as Plan
from paint_deposition.planning.recommendation import Recommendation as Recommendation
from paint_deposition.planning.requests import GunEnvelope as GunEnvelope
from paint_deposition.report.write import plot as plot
from paint_deposition.report.write import write as write

__version__: str

def git_version() -> str: ...
