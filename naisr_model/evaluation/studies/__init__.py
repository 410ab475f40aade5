"""Everything that can be asked of an atlas, by the name of its command."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from naisr_model.evaluation.studies.calibration import Calibration
from naisr_model.evaluation.studies.comparison import Comparison
from naisr_model.evaluation.studies.completion import Completion
from naisr_model.evaluation.studies.confidence import ConfidenceStudy
from naisr_model.evaluation.studies.fitting import Fitting
from naisr_model.evaluation.studies.norms import NormsStudy
from naisr_model.evaluation.studies.reconstruction import Reconstruction
from naisr_model.evaluation.studies.transfer import Transfer
from naisr_model.evaluation.study import Study

STUDIES: Mapping[str, type[Study[Any]]] = MappingProxyType(
    {
        "reconstruction": Reconstruction,
        "comparison": Comparison,
        "transfer": Transfer,
        "completion": Completion,
        "fitting": Fitting,
        "calibration": Calibration,
        "norms": NormsStudy,
        "confidence": ConfidenceStudy,
    }
)
