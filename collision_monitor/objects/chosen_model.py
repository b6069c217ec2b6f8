"""Which model represents an object: that of its description, or that of the profile for its class of shapes."""

from __future__ import annotations

from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import Modelled, monitored_model, parse_model, shape_class
from collision_monitor.records import Model
from collision_monitor.settings.profile import Profile


def chosen_model(description: ObjectDescription, profile: Profile) -> Model:
    """Return the object's own choice, or else the profile's for its class of shapes."""
    kind = shape_class(description.shapes)
    if description.model is not Model.AUTO or kind is None:
        return description.model
    return parse_model(getattr(profile, f"model_{kind}"))


def model_within_error(
    description: ObjectDescription, profile: Profile, prepared: Modelled | None
) -> tuple[Model, Modelled | None]:
    """Return the `chosen_model` and what represents the object by it, if that is known or was made to be measured.

    If the profile's choice exceeds the object by more than its `model_error`, the model is that of the description.
    prepared: what represents the object, if it is known already. Raises the errors of `monitored_model`.
    """
    model = chosen_model(description, profile)
    if model is description.model:
        return model, prepared
    prepared = prepared or monitored_model(description.shapes, model)
    return (description.model, None) if prepared.excess > profile.model_error else (model, prepared)
