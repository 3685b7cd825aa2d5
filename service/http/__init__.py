"""HTTP service: `server` runs `app`; `v1` and `oip` have the routes, `problems` the errors."""
