"""What litags says, and leaves behind, when something goes wrong in the middle of a command."""

import os
import re
import signal
import threading
import unittest

import grpc

import examples
import harness


class CommandLine(harness.ServiceTest):

    relay = examples.Example.relay

    def states_by_job(self):
        request = harness.rpc.ListJobsRequest(page_size=1000)
        return {job.name: job.state for job in self.jobs.ListJobs(request).jobs}

    def test_a_job_whose_start_was_not_answered_is_not_removed(self):
        def lose(call, answer):
            if call == "StartJob":
                raise examples.Lost(lost)
            return answer

        for lost, exit_code in ((grpc.StatusCode.UNAVAILABLE, 3), (grpc.StatusCode.INTERNAL, 5)):
            source = self.finished_job()
            for command in (("submit", self.photos()), ("clone", source)):
                before = self.states_by_job()
                _, err = self.litags("--retry", "0", *command, exit_code=exit_code,
                                     server=self.relay(lose))
                job, = self.states_by_job().keys() - before.keys()
                self.assertIn(f"{job} may have been started; see: litags show {job}\n", err)
                self.assertNotEqual(self.state(job), harness.job_pb2.JOB_STATE_UPLOADING)

    def test_ctrl_c_during_the_start_of_a_job_leaves_it(self):
        started, ended = threading.Event(), threading.Event()

        def hold(call, answer):
            if call == "StartJob":
                started.set()
                ended.wait(harness.PATIENCE_S)
            return answer

        before = self.states_by_job()
        submit = self.start_litags("submit", self.photos(), server=self.relay(hold))
        self.addCleanup(submit.kill)
        self.assertTrue(started.wait(harness.PATIENCE_S))
        submit.send_signal(signal.SIGINT)
        _, err = submit.communicate(timeout=harness.PATIENCE_S)
        ended.set()
        self.assertEqual(submit.returncode, 130, err)
        job, = self.states_by_job().keys() - before.keys()
        self.assertIn(f"{job} may have been started", err)

    def test_doctor_that_is_interrupted_does_not_say_that_a_server_answers(self):
        proxy = self.new_proxy()
        proxy.silent = True
        doctor = self.start_litags("doctor", server=proxy.address)
        self.addCleanup(doctor.kill)
        self.wait_for(lambda: proxy.connections, "a call")
        doctor.send_signal(signal.SIGINT)
        out, err = doctor.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual((doctor.returncode, err), (130, "interrupted\n"))
        self.assertNotIn("answers", out)

    def test_photos_that_were_left_out_are_named_though_the_upload_fails(self):
        photos = self.photos(("a.png", "b.png"))
        for name in ("x.png", "y.png", "z.png"):
            with open(os.path.join(photos, name), "wb") as file:
                file.write(b"no photo")
        _, err = self.litags("submit", photos, exit_code=2)
        for name in ("x.png", "y.png", "z.png"):
            self.assertIn(name, err)
        self.assertEqual(err.count(" is left out: "), 2, err)

    def test_the_help_of_a_filter_has_the_fields_that_the_server_knows(self):
        _, err = self.litags("list", "--filter", "nothing = 1", exit_code=2)
        known = re.search(r"one of the fields (.*?) and (\w+)", " ".join(err.split()))
        fields = [*known[1].split(", "), known[2]]
        out, _ = self.litags("list", "--help")
        told = re.search(r"fields: ([^)]*)\)", " ".join(out.split()))
        self.assertEqual(told[1].split(", "), fields)
        for field in fields:
            value = "RUNNING" if field == "state" else "1" if "priority" in field else \
                '"2026-01-31T12:00:00Z"'
            self.litags("list", "--filter", f"{field} != {value}")

    def test_what_cannot_be_written_is_told_before_anything_is_rendered(self):
        job, calls = self.finished_job(), []

        def count(call, answer):
            calls.append(call)
            return answer

        relay = self.relay(count)
        for command in (("report", job, "-o", "/no/such/folder/report.html"),
                        ("render", job, "--camera", "a.png", "-o", "/no/such/folder/view.png")):
            _, err = self.litags(*command, exit_code=2, server=relay)
            self.assertIn("OUTPUT_NOT_WRITABLE", err)
        self.assertNotIn("RenderView", calls)


if __name__ == "__main__":
    unittest.main(verbosity=2)
