"""Images of a recording in, landmark sightings out; needs no simulator."""
