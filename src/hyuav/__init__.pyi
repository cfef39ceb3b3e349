"""The public names of HyUAV, each once, with the module that defines it.

All that is not listed here may change at any time.
"""

from hyuav._support.errors import InputError as InputError
from hyuav._support.errors import InputTypeError as InputTypeError
from hyuav._support.errors import ScenarioWarning as ScenarioWarning
from hyuav.envs.reward import Reward as Reward
from hyuav.envs.secure_offloading import SecureOffloadingEnv as SecureOffloadingEnv
from hyuav.envs.transforms import make_env as make_env
from hyuav.experiments.comparison.plan import Compare as Compare
from hyuav.experiments.comparison.work import compare as compare
from hyuav.experiments.evaluation import EvaluationParameters as EvaluationParameters
from hyuav.experiments.evaluation import evaluate as evaluate
from hyuav.experiments.fly import fly as fly
from hyuav.experiments.run import Run as Run
from hyuav.experiments.run import load as load
from hyuav.learning.ddpg import DDPG as DDPG
from hyuav.learning.generalist.policy import GeneralistPolicy as GeneralistPolicy
from hyuav.learning.generalist.pretrained import Generalist as Generalist
from hyuav.learning.generalist.pretrained import pretrained as pretrained
from hyuav.learning.guide.parameters import Guide as Guide
from hyuav.learning.guide.robust import RobustDDPG as RobustDDPG
from hyuav.learning.guide.robust import RobustSAC as RobustSAC
from hyuav.learning.guide.robust import RobustTD3 as RobustTD3
from hyuav.learning.learners import Learner as Learner
from hyuav.learning.maddpg import MADDPG as MADDPG
from hyuav.learning.policy import Policy as Policy
from hyuav.learning.registry import register as register
from hyuav.learning.sac import SAC as SAC
from hyuav.learning.td3 import TD3 as TD3
from hyuav.learning.training import Training as Training
from hyuav.learning.training import TrainingParameters as TrainingParameters
from hyuav.physics.families import ClustersLayout as ClustersLayout
from hyuav.physics.families import DiskLayout as DiskLayout
from hyuav.physics.families import RandomLayout as RandomLayout
from hyuav.physics.generators import LayoutFamily as LayoutFamily
from hyuav.physics.layout import clusters as clusters
from hyuav.physics.layout import disk as disk
from hyuav.physics.layout import random_layout as random_layout
from hyuav.physics.scenario import PRESETS as PRESETS
from hyuav.physics.scenario import Scenario as Scenario
from hyuav.physics.scenario_families import family as family
from hyuav.physics.slot import slot as slot
from hyuav.references.flight import FlightPolicy as FlightPolicy
from hyuav.references.optimum import solve_optimum as solve_optimum
from hyuav.references.straight import ja_lt as ja_lt
from hyuav.references.straight import no_helper as no_helper
from hyuav.references.straight import re_lt as re_lt

__all__: list[str]
__version__: str
_ORIGINS: dict[str, tuple[str, str]]
