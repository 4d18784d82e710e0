"""The socket's side of the service: uvicorn's connection, with bounds where its settings end."""
