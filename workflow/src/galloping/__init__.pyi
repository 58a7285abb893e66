"""The public names: type checkers see them here, and `__init__.py` imports each at first use."""

from galloping.behaviour.assess import assess
from galloping.behaviour.assessment import Assessment
from galloping.behaviour.dynamics import Dynamics, Value
from galloping.behaviour.forecast import Forecast
from galloping.configuration.yaml_file import ConfigurationError
from galloping.estimator import MaximumLikelihood, NotFittedError
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.likelihood.weak_gls import weak_gls
from galloping.identification.prior_knowledge import Coefficient, Prior
from galloping.model.polynomial import PolynomialModel, polynomial_library
from galloping.model.terms import parse_library as library
from galloping.model.terms import parse_model
from galloping.plotting import plot_fit, plot_forecast, plot_phase
from galloping.progress_reports import progress
from galloping.recording.samples import Input, Recording
from galloping.stages import cramer_rao_bound, derive, measure, simulate
from galloping.summary.summarise import Summary, dynamics, forecast, summarise
from galloping.trajectory.simulation import Simulator, Trajectory

__version__: str
__all__ = [
    "Assessment",
    "Coefficient",
    "ConfigurationError",
    "Dynamics",
    "Forecast",
    "IdentifiedModel",
    "Input",
    "MaximumLikelihood",
    "NotFittedError",
    "PolynomialModel",
    "Prior",
    "Recording",
    "Simulator",
    "Summary",
    "Trajectory",
    "Value",
    "__version__",
    "assess",
    "cramer_rao_bound",
    "derive",
    "dynamics",
    "forecast",
    "library",
    "maximum_likelihood",
    "measure",
    "parse_model",
    "plot_fit",
    "plot_forecast",
    "plot_phase",
    "polynomial_library",
    "progress",
    "simulate",
    "summarise",
    "weak_gls",
]
