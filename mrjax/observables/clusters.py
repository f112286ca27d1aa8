"""Clusters: particles that are connected by contacts, walls not counted."""

import numpy as np

from mrjax.core.network import ContactNetwork


def cluster_sizes(network: ContactNetwork) -> np.ndarray:
    """Numbers of particles of all clusters, descending, (K,); a lone particle is a cluster of 1.

    The sizes are whole numbers without derivatives. The function cannot be traced.

    Args:
      network: contact network of a state, from `mrjax.contact_network`.

    Example:
      >>> soft = mrjax.Recipe.load("case2").parameters().replace(elastic_modulus=1e5)
      >>> state = mrjax.place([[2e-6, 5e-6, 5e-6], [5.99e-6, 5e-6, 5e-6], [5e-6, 5e-6, 1.5e-5]])
      >>> network = mrjax.contact_network(state, soft, mrjax.Box((2e-5, 2e-5, 2e-5)))
      >>> mrjax.cluster_sizes(network)
      array([2, 1])
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    touching = np.asarray(network.between_particles)
    first, second = np.asarray(network.first)[touching], np.asarray(network.second)[touching]
    shape = (network.particles, network.particles)
    graph = coo_array((np.ones(len(first)), (first, second)), shape=shape)
    _, label = connected_components(graph, directed=False)
    return np.sort(np.bincount(label))[::-1]
