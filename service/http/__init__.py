"""The application: routes, the way of a job, answers, problem documents, the server."""
