# The public names of `piec_envs.rendering`, by topic; see `piec_envs/__init__.pyi`.

# Colours
from .colours import GOAL as GOAL
from .colours import INK as INK
from .colours import KEY_POINT as KEY_POINT
from .colours import OBJECT as OBJECT
from .colours import PALE as PALE
from .colours import TOUCHED as TOUCHED
from .field import WALL as WALL

# Robots and objects on an axis of Matplotlib
from .drawing import draw_ghost as draw_ghost
from .drawing import draw_key_points as draw_key_points
from .drawing import draw_loose as draw_loose
from .drawing import draw_object as draw_object
from .drawing import draw_robot as draw_robot
from .drawing import union_patch as union_patch

# Paths and regions
from .paths import draw_escape_circle as draw_escape_circle
from .paths import draw_escape_path as draw_escape_path
from .paths import draw_goal as draw_goal
from .paths import draw_reference as draw_reference
from .paths import draw_trail as draw_trail
from .paths import draw_workspace as draw_workspace
from .paths import rim as rim

# What those are made of
from .outlines import arm_outlines as arm_outlines
from .outlines import base_position as base_position
from .outlines import link_outlines as link_outlines
from .outlines import scenery_outlines as scenery_outlines

# Escape fields
from .field import FIELD_TOP as FIELD_TOP
from .field import FieldStyle as FieldStyle
from .field import carried_into_wall as carried_into_wall
from .field import draw_field as draw_field
from .field import draw_nodes as draw_nodes
from .field import draw_wall as draw_wall
from .field import field_colours as field_colours
from .field import field_top as field_top

# Ways out, and whether an object is enclosed
from .escape import ENCLOSED as ENCLOSED
from .escape import FREE as FREE
from .escape import Escape as Escape
from .escape import caption as caption
from .escape import draw_escape as draw_escape
from .escape import draw_way as draw_way
from .escape import in_wall as in_wall
from .escape import solve_escape as solve_escape
from .escape import wall_depth as wall_depth
from .escape import way_handle as way_handle
from .escape import way_handles as way_handles

# Views and frames
from .frame import pixels as pixels
from .space import SpaceFrames as SpaceFrames
from .space import task_marks as task_marks
from .view import View as View
from .view import close_view as close_view
