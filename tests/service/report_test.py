"""A job's report: one HTML file, whole, whatever users call their jobs and photos."""

import html.parser
import os
import tempfile
import unittest

import harness

HOSTILE = ('<script>alert(1)<script>.png', 'a"onerror="alert(1).png', "c&lt;b>'.png")


class Page(html.parser.HTMLParser):
    """What a browser makes of the file, as far as tests ask for it."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.words = [], [], []
        self.feed(text)
        self.close()
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data):
        self.words.append(data)


class Reports(harness.ServiceTest):

    def report(self, job):
        path = os.path.join(self.folder, "report.html")
        _, err = self.litags("report", job, "-o", path)
        self.assertRegex(err, r"report\.html: [\d.]+ KiB")
        with open(path, encoding="utf-8") as file:
            return Page(file.read())

    def assert_stands_alone(self, page):
        self.assertNotIn("script", page.tags)
        for name, value in page.attributes:
            self.assertFalse(name.startswith("on"), (name, value))
            self.assertNotIn(name, ("href", "action", "srcset"))
            if name == "src":
                self.assertTrue(value.startswith("data:image/jpeg;base64,/9j/"), value[:60])

    def test_a_finished_job(self):
        page = self.report(self.finished_job())
        self.assert_stands_alone(page)
        self.assertEqual(page.tags.count("img"), 6)  # before and after, from three places
        for words in ("succeeded", "Photos placed 3 of 3", "Loss and quality", "Time of each stage",
                      "--iterations 40 --preview-every 10", "the service hands out no photos"):
            self.assertIn(words, page.text)

    def test_names_that_would_be_markup(self):
        title = '</title><img src="x" onerror="alert(1)">'
        page = self.report(self.submit("--watch", "--name", title, "--iterations", "10",
                                       "--preview-every", "5", names=HOSTILE))
        self.assert_stands_alone(page)
        self.assertEqual(page.text.count(title), 2)  # of the page, and as its heading
        for name in HOSTILE:
            self.assertIn(name, page.text)

    def test_a_job_that_failed(self):
        out, _ = self.litags("submit", self.photos(("fail.png", "b.png", "c.png")), "--watch",
                             exit_code=1)
        page = self.report(out.split()[0])
        self.assert_stands_alone(page)
        self.assertIn("(SFM_TOO_FEW_VIEWS)", page.text)
        self.assertNotIn("img", page.tags)

    def test_a_job_that_runs(self):
        job = self.submit("--iterations", "100000", "--preview-every", "5",
                          names=("slow.png", "b.png", "c.png"))
        self.wait_for(lambda: self.jobs.GetJob(harness.rpc.GetJobRequest(name=job))
                      .HasField("snapshot_iteration"), "a snapshot")
        page = self.report(job)
        self.assertEqual(self.state(job), harness.RUNNING)
        self.assertIn("had not ended", page.text)
        self.assertEqual(page.tags.count("img"), 6)
        self.litags("cancel", job)

    def test_what_is_refused(self):
        job = self.finished_job()
        folder = tempfile.mkdtemp(dir=self.folder)
        path = os.path.join(folder, "none", "report.html")
        _, err = self.litags("report", job, "-o", path, exit_code=2)
        self.assertIn("OUTPUT_NOT_WRITABLE", err)
        _, err = self.litags("report", job, "-o", os.path.join(folder, "report.pdf"), exit_code=2)
        self.assertIn("REPORT_FORMAT_UNKNOWN", err)
        self.litags("report", "0nosuchjob", "-o", os.path.join(folder, "r.html"), exit_code=4)
        self.assertEqual(os.listdir(folder), [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
