"""Pictures of what was found (extra: report)."""
