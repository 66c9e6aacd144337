"""A job's life over a real socket: submit, watch, cancel, resume, delete, list."""

import json
import os
import re
import shutil
import signal
import tempfile
import time
import unittest

import grpc

import harness
from harness import rpc


def event_numbers(text):
    return [int(number) for number in re.findall(r"^#(\d+) ", text, re.MULTILINE)]


def has_pending_signals(pid):
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        return re.search(r"^ShdPnd:\s*0*$", file.read(), re.MULTILINE) is None


class Jobs(harness.ServiceTest):

    def test_a_folder_of_photos_becomes_a_scene(self):
        out, err = self.litags("submit", self.photos(), "--watch", "--iterations", "30", "--name",
                               "Kitchen at night")
        job = self.jobs.GetJob(rpc.GetJobRequest(name=out.strip()))
        self.assertEqual(job.state, harness.SUCCEEDED)
        self.assertEqual(job.photos, 3)
        self.assertEqual(job.options.iterations, 30)
        self.assertEqual(job.display_name, "Kitchen at night")
        self.assertRegex(err, r"(?m)^#\d+ training  30/30")
        self.assertIn("succeeded", err)

    def test_a_job_without_a_title_has_that_of_its_folder(self):
        photos = self.photos()
        out, _ = self.litags("submit", photos + "/", "--iterations", "10")
        self.assertEqual(self.jobs.GetJob(rpc.GetJobRequest(name=out.strip())).display_name,
                         os.path.basename(photos))

    def test_options_reach_the_job(self):
        job = self.submit("--iterations", "12", "--method", "litags-paper", "--tone", "capture",
                          "--seed", "7", "--max-gaussians", "1234", "--white-balance", "camera",
                          "--min-registered", "0.4", "--refine-cameras")
        options = self.jobs.GetJob(rpc.GetJobRequest(name=job)).options
        self.assertEqual(options.method, harness.job_pb2.METHOD_LITAGS_PAPER)
        self.assertEqual(options.tone, harness.job_pb2.TONE_CAPTURE)
        self.assertEqual(options.white_balance, harness.job_pb2.WHITE_BALANCE_CAMERA)
        self.assertEqual((options.seed, options.max_gaussians), (7, 1234))
        self.assertAlmostEqual(options.min_registered, 0.4)
        self.assertTrue(options.refine_cameras)
        html = os.path.join(self.folder, "report.html")
        self.litags("report", job, "-o", html)
        with open(html, encoding="utf-8") as file:
            page = file.read()
        self.assertRegex(page, r"refine-cameras(<[^>]*>|\s)*true")
        self.assertIn("--refine-cameras=true", page)  # as the command line takes a flag

    def test_the_same_request_id_makes_one_job(self):
        photos = self.photos()
        args = ("submit", photos, "--request-id", "once-" + os.path.basename(photos),
                "--iterations", "10")
        first, _ = self.litags(*args)
        second, err = self.litags(*args)
        self.assertEqual(first, second)
        self.assertIn("was submitted before", err)

    def exported(self, job):
        path = os.path.join(self.folder, "scene.ply")
        self.litags("export", job, "-o", path, "--format", "ply-full")
        with open(path, "rb") as file:
            return file.read()

    def test_a_finished_scene_is_trained_further(self):
        job = self.submit("--iterations", "20", "--watch")
        _, err = self.litags("resume", job, exit_code=5)
        self.assertIn("JOB_NOT_RESUMABLE", err)
        _, err = self.litags("resume", job, "--iterations", "10", exit_code=2)
        self.assertIn("ITERATIONS_REDUCED", err)
        self.assert_refused(
            lambda: self.jobs.ResumeJob(rpc.ResumeJobRequest(
                name=job, options=harness.job_pb2.JobOptions(iterations=50, sh_degree=1))),
            grpc.StatusCode.INVALID_ARGUMENT, "OPTION_NOT_RESUMABLE", "options.sh_degree",
            "make a new job")
        before = self.exported(job)
        resumed = self.jobs.ResumeJob(rpc.ResumeJobRequest(
            name=job, options=harness.job_pb2.JobOptions(iterations=35)))
        self.litags("watch", job, "--after", str(resumed.last_event))
        self.litags("resume", job, "--iterations", "50", "--priority", "4")
        self.litags("watch", job)
        found = self.jobs.GetJob(rpc.GetJobRequest(name=job))
        self.assertEqual((found.options.iterations, found.options.schedule_iterations,
                          found.policy.priority, found.report.iterations), (50, 20, 4, 50))
        self.assertEqual(list(found.report.notes), ["resumed at iteration 35"])
        at_once = self.submit("--iterations", "50", "--schedule-iterations", "20", "--watch")
        self.assertEqual(self.exported(job), self.exported(at_once))
        self.assertNotEqual(self.exported(job), before)

    def test_a_job_that_waits_for_its_turn_says_its_place(self):
        running = self.submit("--iterations", "100000", names=("slow.png", "b.png", "c.png"))
        self.wait_for(lambda: self.state(running) == harness.job_pb2.JOB_STATE_RUNNING, "running")
        job, err = self.litags("submit", self.photos())
        self.assertIn(f"{job.strip()} is queued, number 1", err)
        self.litags("cancel", running)
        out, _ = self.litags("watch", job.strip())
        self.assertIn("#2 queued\n", out)

    def test_watching_over_a_cut_connection_loses_and_doubles_nothing(self):
        job = self.submit("--iterations", "100000", names=("slow.png", "b.png", "c.png"))
        proxy = self.new_proxy()
        watch = self.start_litags("watch", job, "--json", server=proxy.address)
        numbers = []
        next_cut = 3  # events
        for line in watch.stdout:
            numbers.append(int(json.loads(line)["number"]))
            # Three cuts, each of a connection that has brought something.
            if proxy.connections <= 3 and len(numbers) >= next_cut:
                cut_connections = proxy.connections
                proxy.cut()
                self.wait_for(lambda: proxy.connections > cut_connections, "another connection")
                next_cut = len(numbers) + 3
            elif proxy.connections > 3 and len(numbers) == next_cut:
                self.litags("cancel", job)
        self.assertEqual(watch.wait(harness.PATIENCE_S), 1, watch.stderr.read())
        watch.stdout.close()
        watch.stderr.close()
        self.assertGreater(proxy.connections, 3)
        last = self.jobs.GetJob(rpc.GetJobRequest(name=job)).last_event
        self.assertEqual(numbers, list(range(1, last + 1)))

    def test_watching_over_a_crash_of_the_worker_loses_and_doubles_nothing(self):
        job = self.submit("--iterations", "60", "--checkpoint-every", "10",
                          names=("crash-once.png", "b.png", "c.png"))
        out, _ = self.litags("watch", job, "--json")
        events = [json.loads(line) for line in out.splitlines()]
        last = self.jobs.GetJob(rpc.GetJobRequest(name=job)).last_event
        self.assertEqual([int(event["number"]) for event in events], list(range(1, last + 1)))
        states = [event["stateChange"]["state"] for event in events if "stateChange" in event]
        self.assertEqual(states.count("JOB_STATE_RUNNING"), 2)

    def test_python_resumes_a_watch_after_the_last_number(self):
        job = self.submit("--iterations", "100", names=("slow.png", "b.png", "c.png"))
        stream = self.jobs.WatchJob(rpc.WatchJobRequest(name=job))
        numbers = [next(stream).number for _ in range(4)]
        stream.cancel()
        for event in self.jobs.WatchJob(rpc.WatchJobRequest(name=job, after_event=numbers[-1])):
            numbers.append(event.number)
        last = self.jobs.GetJob(rpc.GetJobRequest(name=job)).last_event
        self.assertEqual(numbers, list(range(1, last + 1)))

    def test_watch_after_a_number_shows_only_what_followed(self):
        job = self.finished_job()
        last = self.jobs.GetJob(rpc.GetJobRequest(name=job)).last_event
        out, _ = self.litags("watch", job, "--after", str(last - 2))
        self.assertEqual(event_numbers(out), [last - 1, last])

    def test_ctrl_c_stops_watching_and_leaves_the_job_alone(self):
        job = self.submit("--iterations", "100000", names=("slow.png", "b.png", "c.png"))
        watch = self.start_litags("watch", job)
        self.assertRegex(watch.stdout.readline(), r"^#1 ")
        watch.send_signal(signal.SIGINT)
        # Not communicate(): it would lose lines that readline() has buffered.
        out, err = watch.stdout.read(), watch.stderr.read()
        self.assertEqual(watch.wait(harness.PATIENCE_S), 130)
        numbers = event_numbers(out) or [1]
        self.assertIn(f"goes on\n  follow it again: litags watch {job} --after {numbers[-1]}", err)
        self.assertIn(self.state(job), (harness.job_pb2.JOB_STATE_QUEUED, harness.RUNNING))
        self.litags("cancel", job)

    def test_the_first_ctrl_c_removes_the_job_and_the_second_waits_for_nothing(self):
        photos = self.photos()
        for seed, name in enumerate(("a.png", "b.png", "c.png")):
            with open(os.path.join(photos, name), "wb") as file:
                file.write(harness.large_png(seed))
        proxy = self.new_proxy(silent_after=200_000)
        submit = self.start_litags("submit", photos, server=proxy.address)
        self.addCleanup(submit.kill)
        self.wait_for(lambda: proxy.silent, "an upload that has begun")
        submit.send_signal(signal.SIGINT)
        self.wait_for(lambda: not has_pending_signals(submit.pid), "the first to be heard")
        self.assertIsNone(submit.poll(), "waits for the server, to remove the job")
        submit.send_signal(signal.SIGINT)
        _, err = submit.communicate(timeout=harness.PATIENCE_S)
        self.assertEqual(submit.returncode, 130, err)
        self.assertNotIn("is still there", err, "it waited")

    def test_cancel_stops_a_running_job_before_its_end_and_resume_continues_it(self):
        job = self.submit("--iterations", "500", "--checkpoint-every", "10",
                          names=("slow.png", "b.png", "c.png"))
        self.wait_for(lambda: self.jobs.GetJob(rpc.GetJobRequest(name=job)).progress.iteration > 20,
                      "iteration 20")
        self.litags("cancel", job)
        # A job that ran to its end would be SUCCEEDED.
        self.wait_for(lambda: self.state(job) == harness.CANCELLED, "the end of a cancelled job")
        out, _ = self.litags("watch", job, exit_code=1)
        self.assertIn("is cancelled", out)
        self.litags("resume", job)
        out, _ = self.litags("watch", job)
        self.assertRegex(out, r"note: resumed at iteration [1-9]")

    def test_a_job_that_runs_too_long_fails_and_resume_goes_on(self):
        job = self.submit("--iterations", "150", "--checkpoint-every", "10", "--max-run-seconds",
                          "1.5", names=("slow.png", "b.png", "c.png"))
        out, _ = self.litags("watch", job, exit_code=1)
        self.assertIn("RUN_TIME_EXCEEDED", out)
        self.assertIn("ResumeJob goes on", out)
        for _ in range(30):  # 3 s of work, 1.5 s at a time, more on a busy machine
            self.litags("resume", job)
            self.wait_for(lambda: self.state(job) in (harness.SUCCEEDED, harness.FAILED), "an end")
            if self.state(job) == harness.SUCCEEDED:
                break
        report = self.jobs.GetJob(rpc.GetJobRequest(name=job)).report
        self.assertRegex(report.notes[0], "resumed at iteration [1-9]")

    def test_a_job_that_takes_too_much_memory_fails_and_its_worker_lives(self):
        job = self.submit("--iterations", "20", "--max-memory", "200M",
                          names=("hungry.png", "b.png", "c.png"))
        out, _ = self.litags("watch", job, exit_code=1)
        self.assertIn("MEMORY_EXCEEDED", out)
        self.assertIn("max_gaussians lower", out)
        self.assertEqual(self.jobs.GetJob(rpc.GetJobRequest(name=job)).attempt, 1)
        self.litags("watch", self.submit("--iterations", "10"))

    def test_urgent_jobs_overtake_waiting_ones(self):
        first = self.submit("--iterations", "20", names=("hang.png", "b.png", "c.png"))
        waiting = self.submit("--iterations", "10")
        urgent = self.submit("--iterations", "10", "--priority", "5")
        self.litags("cancel", first)
        for job in (waiting, urgent):
            self.litags("watch", job)
        start = {job: self.jobs.GetJob(rpc.GetJobRequest(name=job)).start_time.ToNanoseconds()
                 for job in (waiting, urgent)}
        self.assertLess(start[urgent], start[waiting])

    def test_a_job_that_fails_says_why_and_what_to_do(self):
        job = self.submit("--iterations", "10", names=("fail.png", "b.png", "c.png"))
        out, _ = self.litags("watch", job, exit_code=1)
        self.assertRegex(out, r"failed: .*overlap more\n  field:  images\n"
                              r"  reason: SFM_TOO_FEW_VIEWS")

    def test_deleting_removes_the_job(self):
        job = self.submit("--iterations", "10")
        self.litags("watch", job)
        self.litags("delete", job)
        _, err = self.litags("show", job, exit_code=4)
        self.assertIn("JOB_NOT_FOUND", err)

    def test_list_and_show_name_the_job(self):
        job = self.finished_job()
        out, _ = self.litags("list")
        self.assertRegex(out, rf"(?m)^{job} +succeeded ")
        shown = json.loads(self.litags("show", job.removeprefix("jobs/"), "--json")[0])
        self.assertEqual((shown["name"], shown["state"]), (job, "JOB_STATE_SUCCEEDED"))
        out, _ = self.litags("show", job)
        self.assertRegex(out, r"(?m)^options    method=litags tone=capture iterations=\d+ ")

    def test_a_label_before_the_folder_leaves_the_folder_alone(self):
        out, _ = self.litags("submit", "--label", "site=north", "--worker-labels", "none-here",
                             self.photos(), "--iterations", "10")
        job = self.jobs.GetJob(harness.rpc.GetJobRequest(name=out.strip()))
        self.assertEqual(dict(job.labels), {"site": "north"})
        self.litags("cancel", job.name)
        _, err = self.litags("update", job.name, "--label", "=north", exit_code=2)
        self.assertIn("a label is KEY=VALUE", err)
        _, err = self.litags("update", job.name, "--label", "a=b", "--remove-label", "a", exit_code=2)
        self.assertIn("leave one out", err)

    def test_the_options_of_a_server_stand_in_columns(self):
        lines = self.litags("info")[0].split("options of a job:\n")[1].splitlines()
        column = lines[0].index("MEANING")
        self.assertTrue(all(line[column - 1] == " " and line[column] != " " for line in lines), lines)

    def test_doctor_finds_everything_in_place(self):
        out, _ = self.litags("doctor")
        self.assertRegex(out, r"health +serving")
        self.assertRegex(out, r"litags\.v1: works")


class Restart(unittest.TestCase):

    def test_a_watch_survives_kill_9_of_the_server(self):
        folder = tempfile.mkdtemp(prefix="litags-restart-")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        helper = harness.ServiceTest()
        helper.class_folder = folder
        helper.setUp()
        helper.server = harness.Server(folder)
        port = helper.server.port
        job = helper.submit("--iterations", "500", "--checkpoint-every", "10",
                            names=("slow.png", "b.png", "c.png"))
        watch = helper.start_litags("watch", job, "--json")
        numbers = [int(json.loads(watch.stdout.readline())["number"]) for _ in range(4)]
        helper.server.kill()
        time.sleep(0.5)
        helper.server = harness.Server(folder, port)
        self.addCleanup(helper.server.stop)
        for line in watch.stdout:
            numbers.append(int(json.loads(line)["number"]))
        self.assertEqual(watch.wait(harness.PATIENCE_S), 0, watch.stderr.read())
        watch.stdout.close()
        watch.stderr.close()
        with grpc.insecure_channel(helper.server.address) as channel:
            stub = harness.reconstruction_service_pb2_grpc.ReconstructionServiceStub(channel)
            last = stub.GetJob(rpc.GetJobRequest(name=job))
        self.assertEqual(last.state, harness.SUCCEEDED)
        self.assertEqual(numbers, list(range(1, last.last_event + 1)))


if __name__ == "__main__":
    unittest.main(verbosity=2)
