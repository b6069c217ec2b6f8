"""Nearest and deepest places of trees, and of trees and convex solids."""
