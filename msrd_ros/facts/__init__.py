"""Ground floor: plain facts that every wing shares. Imports nothing of the package above it."""
