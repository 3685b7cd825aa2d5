"""The HTTP door: `app` has the routes, `uploads` the bytes, `problems` the errors."""
