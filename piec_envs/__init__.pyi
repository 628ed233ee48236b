# The front door: every public name, by topic. `__init__.py` reads this file to load each name at
# its first use, and
# type checkers read it for the types, so that there is no other list. What is not here may move at
# any time.

__version__: str

# Namespaces: pictures, wrappers, and what programs around the suite share
from . import console as console
from . import files as files
from . import provenance as provenance
from . import rendering as rendering
from . import wrappers as wrappers

# Compilation
from .compilation import pending_kernels as pending_kernels

# Tables: environments, robots, objects, tasks
from .env.registry import ENVS as ENVS
from .env.registry import MOTIONS as MOTIONS
from .env.registry import check_motion as check_motion
from .env.registry import register_task as register_task
from .world.robots import ROBOTS as ROBOTS
from .world.robots import Joint as Joint
from .world.robots import Link as Link
from .world.robots import Robot as Robot
from .world.robots import get_robot as get_robot
from .world.robots.franka import FRANKA_BASES as FRANKA_BASES
from .world.robots.franka import FRANKA_CONTACTS as FRANKA_CONTACTS
from .world.robots.franka import FRANKA_GEOMETRIES as FRANKA_GEOMETRIES
from .world.robots.franka import franka_name as franka_name
from .world.objects import OBJECTS as OBJECTS
from .world.objects import Loose as Loose
from .world.objects import Object as Object
from .world.objects import get_object as get_object
from .world.shapes import RoundedPolygon as RoundedPolygon
from .world.shapes import box as box
from .world.shapes import capsule as capsule
from .world.shapes import disc as disc
from .world.shapes import regular_polygon as regular_polygon
from .model.task import TASKS as TASKS
from .model.task import Task as Task
from .model.task import get_task as get_task

# The stage cost, its presets, and when an episode succeeds
from .model.task import GOAL_RADIUS as GOAL_RADIUS
from .model.terms import MEASURE_COLUMNS as MEASURE_COLUMNS
from .model.terms import MEASURES as MEASURES
from .model.task import PAPER_PRESETS as PAPER_PRESETS
from .model.task import PAPER_REFERENCE_POINTS as PAPER_REFERENCE_POINTS
from .model.task import PRESETS as PRESETS
from .model.task import PRIORS as PRIORS
from .model.task import TRACKING_TOLERANCE as TRACKING_TOLERANCE
from .model.task import CostWeights as CostWeights

# Episodes as values: what is set, the state, and what follows from it
from .model.model import Model as Model
from .model.setup import Setup as Setup
from .model.terms import TERMS as TERMS
from .model.terms import Term as Term
from .env.config import EnvConfig as EnvConfig
from .env.makers import make_config as make_config
from .env.makers import make_model as make_model
from .env.makers import make_setup as make_setup
from .env.info import row_info as row_info
from .model.rollout import Rollout as Rollout
from .model.start import ALLOWED_PENETRATION as ALLOWED_PENETRATION
from .dynamics.plant import PlantParams as PlantParams
from .model.state import State as State

# Static caging: a problem, and postures that solve it
from .model.caging_problem import CagingProblem as CagingProblem
from .model.caging_problem import Postures as Postures

# Contact dynamics
from .dynamics.protocol import CONTROL_PERIOD as CONTROL_PERIOD
from .dynamics.protocol import Commands as Commands
from .dynamics.protocol import Dynamics as Dynamics
from .dynamics.protocol import Motion as Motion
from .dynamics.protocol import Plant as Plant
from .dynamics.by_row import DYNAMICS as DYNAMICS
from .dynamics.by_row import Backend as Backend
from .dynamics.quasi_dynamic import SOLVERS as SOLVERS
from .dynamics.quasi_dynamic import QuasiDynamics as QuasiDynamics
from .dynamics.mujoco_ import MujocoDynamics as MujocoDynamics
from .dynamics.mjcf import mujoco_model as mujoco_model

# Kinematics and distances
from .geometry.batched import object_distances as object_distances
from .geometry.batched import robot_frames as robot_frames
from .geometry.batched import robot_vertices as robot_vertices
from .geometry.batched import self_distances as self_distances
from .geometry.surface import trace_surface as trace_surface
from .geometry.rdf import RobotDistanceField as RobotDistanceField
from .geometry.rdf import panda_distance_field as panda_distance_field
from .escape.samples import robot_distance as robot_distance

# Escape fields, and the escape time of an object
from .escape.field import CAGING_SCALE as CAGING_SCALE
from .escape.field import FIELDS as FIELDS
from .escape.field import REDUCTIONS as REDUCTIONS
from .escape.protocol import EscapeField as EscapeField
from .escape.field import choose_field as choose_field
from .escape.field import key_points_world as key_points_world
from .escape.field import make_field as make_field
from .escape.field import enclosed_points as enclosed_points
from .escape.field import object_escape_time as object_escape_time
from .escape.base import BatchedField as BatchedField
from .escape.protocol import FieldMap as FieldMap
from .escape.grid import GridField as GridField
from .escape.network import NetworkField as NetworkField
from .escape.obstacle import ObstacleField as ObstacleField
from .escape.obstacle import even_speed as even_speed
from .escape.speed import SpeedModel as SpeedModel
from .escape.table import TableField as TableField

# Random configurations and points on which fields are trained and judged
from .escape.samples import draw_configurations as draw_configurations
from .escape.samples import draw_points as draw_points

# Learned fields: training (with the extra `learn`) and weights
from .escape.training import RECIPES as RECIPES
from .escape.training import Recipe as Recipe
from .escape.training import get_recipe as get_recipe
from .escape.training import train_field as train_field
from .escape.weights import FieldWeights as FieldWeights
from .escape.weights import has_weights as has_weights
from .escape.weights import shipped_file as shipped_file

# Threads
from .parallel import available_threads as available_threads

# Errors: all are `PiecError`
from .errors import AgentError as AgentError
from .errors import DistanceFieldError as DistanceFieldError
from .errors import EngineError as EngineError
from .errors import InvalidActionError as InvalidActionError
from .errors import InvalidObservationError as InvalidObservationError
from .errors import InvalidParameterError as InvalidParameterError
from .errors import InvalidShapeError as InvalidShapeError
from .errors import InvalidStateError as InvalidStateError
from .errors import MeshError as MeshError
from .errors import MissingDependencyError as MissingDependencyError
from .errors import PiecError as PiecError
from .errors import PlanError as PlanError
from .errors import RecordError as RecordError
from .errors import RenderingError as RenderingError
from .errors import ResetNeededError as ResetNeededError
from .errors import ShadowedPackageError as ShadowedPackageError
from .errors import UnknownArgumentError as UnknownArgumentError
from .errors import UnknownNameError as UnknownNameError
from .errors import WeightsError as WeightsError
from .env.registry import NoMotionError as NoMotionError

# Checks of what is given, which raise them
from .errors import as_count as as_count
from .errors import as_floats as as_floats
from .errors import check_arguments as check_arguments
from .errors import check_name as check_name
from .shadows import check_not_shadowed as check_not_shadowed
