"""Everything that a monitor reported in a run, as arrays, with the step of each row."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.monitor.result import StepResult
from collision_monitor.records import joined

Rows = NDArray[np.void]
Steps = NDArray[np.int64]


class Reported(NamedTuple):
    """contacts: records.CONTACT, the first point of each; predictions: records.PREDICTION. The steps are indices."""

    contacts: Rows
    contact_step: Steps
    predictions: Rows
    prediction_step: Steps

    def until(self, step: int) -> Reported:
        """The rows of the steps before this one."""
        return Reported(
            self.contacts[self.contact_step < step],
            self.contact_step[self.contact_step < step],
            self.predictions[self.prediction_step < step],
            self.prediction_step[self.prediction_step < step],
        )

    @classmethod
    def of(cls, answers: Sequence[StepResult]) -> Self:
        """Gather the answers of consecutive steps."""
        contacts = [each.contacts.compress(each.contacts["point_index"] == 0) for each in answers]
        predictions = [each.predictions for each in answers]
        return cls(
            joined([np.zeros(0, records.CONTACT), *contacts]),
            _steps(contacts),
            joined([np.zeros(0, records.PREDICTION), *predictions]),
            _steps(predictions),
        )


def _steps(rows: Sequence[Rows]) -> Steps:
    return np.repeat(np.arange(len(rows)), [len(each) for each in rows])
