"""What a controller on a Slurm cluster needs beside the plugin: that it can see its jobs, and keeps them in sight."""

from mtcsirl import slurm


class AtSlurm:
    """The jobs that were sent and are not over, by Slurm's number.

    The plugin drops all of its jobs the first time that Slurm does not answer, and so would wait for ever.
    """

    def __init__(self, executor):
        self._executor, self._sent, self._over, self._dropped = executor, {}, set(), set()
        executor.report_job_submission = self._noted(executor.report_job_submission)
        executor.report_job_success = self._once(executor.report_job_success)
        executor.report_job_error = self._once(executor.report_job_error)

    def numbers(self):
        """What Slurm should know."""
        return set(self._sent) - self._over

    def take_back(self):
        """Give the plugin what it dropped; twice missing is dropped, as it puts its jobs aside while it asks."""
        with self._executor.lock:
            missing = self.numbers() - {sent.external_jobid for sent in self._executor.active_jobs}
            self._executor.active_jobs += [self._sent[number] for number in missing & self._dropped]
        self._dropped = missing - self._dropped

    def _noted(self, tell):

        def sends(sent, *more, **named):
            self._sent[sent.external_jobid] = sent
            tell(sent, *more, **named)

        return sends

    def _once(self, tell):
        """Snakemake ends at a job that is reported twice, as one would be that was taken back too early."""

        def ends(sent, *more, **named):
            if sent.external_jobid not in self._over:
                self._over |= {sent.external_jobid} - {None}  # None: it could not be sent
                tell(sent, *more, **named)

        return ends


def watch_slurm():
    """Where jobs go to Slurm: see that it answers, and say so as soon as it no longer does."""
    if workflow.executor_plugin.name != "slurm":
        return
    asked = workflow.executor_settings
    try:
        command = slurm.answering(asked.status_command, asked.init_seconds_before_status_checks)
    except UserError as error:
        sys.exit(str(error))
    slurm.Watch(command, AtSlurm(workflow.scheduler._executor), logger.warning).start()
