"""Worker processes: jobs that can be killed, their memory files, the models that they hold."""
