"""What all sources share: frames, tracks, states that wait, entries of the sources file."""
