from .design.design import Design, design_whisker
from .design.limits import DesignError, Limits, Request
from .design.tuned import Tuned, tune
from .estimation.edges import edge_map
from .estimation.friction import LandFriction, land_friction
from .estimation.profiled import estimate_relief
from .estimation.relief import Relief, relief_from_edges
from .scan.calibration import Calibration, calibrate_lead_in
from .scan.recording import load_scan, save_calibration, save_scan
from .scan.scan import Scan, trace_scan
from .scan.sensor import SensorChain, SensorError, draw_sensor_chain
from .scan.session import Fitting, StageSession
from .scan.simulated_session import SimulatedSession
from .scan.stage_error import StageError
from .scan.sweep import Sweep
from .simulation.traces import Fidelity, SampleFlag
from .whisker.array import RasterPlan, default_plan
from .whisker.beam import Segment
from .whisker.comb import WhiskerArray
from .whisker.defaults import default_preload_mm, default_whisker
from .whisker.elastica import ElasticaError, LargeDeflection, large_deflection
from .whisker.enhancement import enhancement_factor, moment_ratio
from .whisker.passes import Pass, SweepPlan
from .whisker.sections import MUSIC_WIRE, Material, Rectangle, Round, Taper, Tube, WhiskerError
from .whisker.shapes import Chain, LShaped, TipModel, straight_whisker
from .whisker.touch import Touch, default_touch, profiling_touch

__all__ = [
    "MUSIC_WIRE", "Calibration", "Chain", "Design", "DesignError", "ElasticaError", "Fidelity",
    "Fitting", "LShaped", "LandFriction", "LargeDeflection", "Limits", "Material", "Pass", "RasterPlan",
    "Rectangle", "Relief", "Request", "Round", "SampleFlag", "Scan", "Segment", "SensorChain",
    "SensorError", "SimulatedSession", "StageError", "StageSession", "Sweep", "SweepPlan",
    "Taper", "TipModel", "Touch", "Tube", "Tuned", "WhiskerArray", "WhiskerError",
    "calibrate_lead_in", "default_plan", "default_preload_mm", "default_touch",
    "default_whisker", "design_whisker", "draw_sensor_chain", "edge_map", "enhancement_factor",
    "estimate_relief", "land_friction", "large_deflection", "load_scan", "moment_ratio",
    "profiling_touch", "relief_from_edges", "save_calibration", "save_scan", "straight_whisker", "trace_scan", "tune",
]  # fmt: skip
