from .base_filter import BaseFilterOptions as BaseFilterOptions
from .estimator import EstimatorOptions as EstimatorOptions
from .estimator import StateEstimator as StateEstimator
from .imu import ImuOptions as ImuOptions
from .joint_filter import JointFilterOptions as JointFilterOptions
from .readings import Readings as Readings
