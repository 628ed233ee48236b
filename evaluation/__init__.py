"""Evaluation of policies and plans: rollouts, protocols, metrics, records, tables, figures and studies."""
