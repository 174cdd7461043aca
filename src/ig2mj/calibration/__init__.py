"""How large a batched engine's buffers must be for a scene, and the pushing hand that disturbs it to find out."""
