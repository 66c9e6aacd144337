"""A new job on the page with what cannot be sent, step by step, in new_job_steps.mjs.

Skipped, and says so, without Chromium, without npm, or where the server was built without the page.
"""

import os
import pathlib
import subprocess

import browser_test
import gateway
import harness
from browser_test import npm_packages


class NewJob(gateway.GatewayTest):

    extra = ("--max-job-bytes", str(1 << 20))  # less than a large photo has

    def test_the_steps(self):
        if b"app.js" not in self.web.get("/").body:
            self.skipTest("the server was built without the page")
        folder = pathlib.Path(self.photos())
        (folder / "large.png").write_bytes(harness.large_png())
        environment = dict(
            os.environ, URL=f"http://127.0.0.1:{self.server.web_port}", PHOTOS=str(folder),
            CHROMIUM=npm_packages.CHROMIUM, HOME=self.folder,
            PATIENCE_MS=str(1000 * harness.PATIENCE_S))
        steps = subprocess.run(["node", browser_test.WORK / "new_job_steps.mjs"], env=environment)
        self.assertEqual(steps.returncode, 0, "a step failed; see above")


if __name__ == "__main__":
    npm_packages.run_browser_tests(browser_test.HERE, browser_test.WORK, "new_job_steps.mjs")
