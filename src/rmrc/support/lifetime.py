"""Whether this process ends with its job, as that of the command line does: it need not search its memory."""

ends_with_job = False
