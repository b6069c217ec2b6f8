"""Replay: computes the answers to recorded inputs again and compares them with the recorded ones."""
