"""Programs that measure ig2mj; `README.md` in this folder says which command makes which published figure."""
