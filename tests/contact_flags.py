"""Flags of contacts, tick by tick."""

from template_control.embedding.contacts import DUE, NO_FORCE, update_contacts


def take_in(monitor, flags, force, expected, dt):
    """A tick's flags and forces, if any; None is expected of a foot that is due to land."""
    monitor.data["expected"] = [DUE if due is None else int(due) for due in expected]
    update_contacts(monitor.data[0], flags, NO_FORCE if force is None else force, dt)
