"""A new job on the page with what cannot be sent, step by step, in new_job_steps.mjs; what the page
says of a job, in job_steps.mjs; answers that are lost, in lost_answers_steps.mjs.

Skipped, and says so, without Chromium, without npm, or where its registry cannot be reached.
"""

import os
import pathlib
import shutil
import subprocess

import browser_test
import gateway
import harness
from browser_test import npm_packages


class NewJob(gateway.GatewayTest):

    extra = ("--max-job-bytes", str(1 << 20))  # less than a large photo has

    def setUp(self):
        super().setUp()
        if b"app.js" not in self.web.get("/").body:
            self.fail("the server was built without the page")

    def run_steps(self, name, **environment):
        environment = dict(
            os.environ, URL=f"http://127.0.0.1:{self.server.web_port}",
            CHROMIUM=npm_packages.CHROMIUM, HOME=self.folder, MESSAGES=gateway.messages(),
            PATIENCE_MS=str(1000 * harness.PATIENCE_S), **environment)
        steps = subprocess.run(["node", browser_test.WORK / name], env=environment)
        self.assertEqual(steps.returncode, 0, "a step failed; see above")

    def test_a_new_job(self):
        folder = pathlib.Path(self.photos())
        (folder / "large.png").write_bytes(harness.large_png())
        packed = pathlib.Path(self.photos())
        (packed / "bad.png").write_bytes(b"no photo")
        archive = shutil.make_archive(os.path.join(self.folder, "night"), "zip", packed)
        self.run_steps("new_job_steps.mjs", PHOTOS=str(folder), ARCHIVE=archive,
                       MASKED=self.masked_photos("masked", "a.png", "b.png", "c.png", "bad.png"),
                       FOUR=self.masked_photos("four", "a.png", "b.png", "c.png", "d.png"))

    def masked_photos(self, folder, *names):
        """A folder of photos, each with a mask; bad.png is cut short."""
        folder = pathlib.Path(self.folder, folder)
        (folder / "masks").mkdir(parents=True)
        for seed, name in enumerate(names):
            photo = harness.png(seed=seed)
            (folder / name).write_bytes(photo[:len(photo) // 2] if name == "bad.png" else photo)
            (folder / "masks" / name).write_bytes(photo)
        return str(folder)

    def test_answers_that_are_lost(self):
        self.run_steps("lost_answers_steps.mjs", PHOTOS=self.photos(), JOB=self.web_job())

    def test_a_server_that_is_silent(self):
        folder = pathlib.Path(self.photos())
        (folder / "b.png").write_bytes(harness.png(seed=77))  # no job has it
        self.run_steps("connection_steps.mjs", PHOTOS=str(folder), JOB=self.web_job(),
                       SERVER=str(self.server.process.pid))

    def test_the_list_of_jobs(self):
        self.web_job()
        self.run_steps("list_steps.mjs")

    def test_what_is_said_of_a_job(self):
        self.run_steps("job_steps.mjs", JOB=self.web_job())


if __name__ == "__main__":
    npm_packages.run_browser_tests(browser_test.HERE, browser_test.WORK, "new_job_steps.mjs",
                                   "job_steps.mjs", "lost_answers_steps.mjs", "connection_steps.mjs",
                                   "list_steps.mjs", "steps.mjs")
