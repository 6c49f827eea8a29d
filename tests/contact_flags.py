"""Flags of contacts, tick by tick."""

from template_control.estimation.contacts import DUE, NO_FORCE, update_contacts


def take_in(contacts, flags, force, expected, dt):
    """A tick's flags and forces, if any; None is expected of a foot that is due to land.

    Returns which feet stand; ``contacts`` (1,) are overwritten.
    """
    contacts["expected"] = [DUE if due is None else int(due) for due in expected]
    update_contacts(contacts[0], flags, NO_FORCE if force is None else force, dt)
    return contacts["standing"][0].astype(bool)
