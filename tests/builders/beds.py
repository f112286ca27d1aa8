"""Small beds: twenty particles of case 2 between walls, softened, and where they start."""

import numpy as np

import mrjax

OVERLAP = 0.05
WALLED = mrjax.Box((10e-6, 10e-6, 20e-6))


def dispersed(case2, box, seed):
    """A start whose highest particle is as high as that of all others, so that all take the same
    frames: `settle` chooses them from the highest particle of all states."""
    state = mrjax.disperse(case2.model_copy(update={"box": box}), seed)
    position = np.array(state.position)
    position[position[:, 2].argmax(), 2] = box.height - 2.001e-6  # it moves away from all below
    return mrjax.place(position, contact_diameter=state.contact_diameter)


def soft(case2, box, **changes):
    parameters = case2.parameters().replace(**changes)
    count = case2.model_copy(update={"box": box}).particle_count
    return mrjax.softened(parameters, box, count, OVERLAP)
