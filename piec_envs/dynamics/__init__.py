"""Contact dynamics: how commands move the arm and the arm moves the object."""
