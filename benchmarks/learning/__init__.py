"""Trained policies, experts, learners."""
