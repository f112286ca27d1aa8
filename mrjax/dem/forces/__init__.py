"""The forces on every particle, one file a force. Drag is part of the integrator."""
