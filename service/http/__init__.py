"""The application: routes, admission, limits on bodies, problem documents, the server."""
