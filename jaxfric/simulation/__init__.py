"""A model forward in time: plant, controllers, closed loops; and the force that a motion needs."""
