"""The files in deploy/ against themselves and against the programs: every manifest parses, names and
ports that refer to each other match, no secret is in them, and every variable and flag is one that the
program knows. What only a cluster can say is not tested here."""

import glob
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import skipping
import yaml

PATIENCE_S = 60
DEPLOY = os.environ["LITAGS_DEPLOY"]
BIN = os.environ["LITAGS_BIN"]
PROGRAMS = {name: os.path.join(BIN, program) for name, program in (
    ("litags-server", os.environ["LITAGS_SERVER_PROGRAM"]),
    ("litags-worker", os.environ["LITAGS_WORKER_PROGRAM"]), ("litags", "litags"))}
KUBERNETES = os.path.join(DEPLOY, "kubernetes")
# What others read: the S3 client's, as everywhere.
FOREIGN = {"AWS_REGION", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN"}
# What operators make, as base/settings.yaml says, with the keys in each.
SECRETS = {"litags-store": {"url"}, "litags-s3": {"AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"},
           "litags-tls": {"tls.crt", "tls.key", "ca.crt"}, "litags-tokens": {"tokens"}}
API_VERSIONS = {"Deployment": "apps/v1", "Service": "v1", "ConfigMap": "v1", "ServiceAccount": "v1",
                "PodDisruptionBudget": "policy/v1", "NetworkPolicy": "networking.k8s.io/v1",
                "HorizontalPodAutoscaler": "autoscaling/v2"}


def run(*command, env=None):
    done = subprocess.run(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, timeout=PATIENCE_S)
    return done.returncode, done.stdout


def documents(path):
    with open(path) as file:
        return [document for document in yaml.safe_load_all(file) if document]


def base():
    """The objects of the base, as its kustomization lists them."""
    folder = os.path.join(KUBERNETES, "base")
    kustomization, = documents(os.path.join(folder, "kustomization.yaml"))
    files = sorted(os.listdir(folder))
    assert sorted(kustomization["resources"] + ["kustomization.yaml"]) == files, files
    return [d for name in kustomization["resources"] for d in documents(os.path.join(folder, name))]


def built(overlay):
    """The objects that kubectl makes of an overlay, or None without kubectl."""
    if not shutil.which("kubectl"):
        return None
    code, out = run("kubectl", "kustomize", os.path.join(KUBERNETES, overlay))
    assert code == 0, out
    return list(yaml.safe_load_all(out))


def named(objects, kind, name):
    found, = [o for o in objects if o["kind"] == kind and o["metadata"]["name"] == name]
    return found


def container(objects, deployment):
    containers = named(objects, "Deployment", deployment)["spec"]["template"]["spec"]["containers"]
    assert len(containers) == 1
    return containers[0]


def environment(objects, container):
    """The variables of a container; those from Secrets have a stand-in of the right form."""
    stand_in = {"url": "postgresql://litags:secret@db/litags"}
    result = {}
    for source in container["envFrom"]:
        if "configMapRef" in source:
            result.update(named(objects, "ConfigMap", source["configMapRef"]["name"])["data"])
        else:
            result.update({key: "x" for key in SECRETS[source["secretRef"]["name"]]})
    for variable in container["env"]:
        if "value" in variable:
            result[variable["name"]] = variable["value"]
        else:
            key = variable["valueFrom"]["secretKeyRef"]["key"]
            result[variable["name"]] = stand_in.get(key, "x")
    return result


def processes(pid):
    """The process and all that descend from it, itself first."""
    found = [pid]
    for one in found:
        for path in glob.glob(f"/proc/{one}/task/*/children"):
            with open(path) as file:
                found += map(int, file.read().split())
    return found


class Programs:
    """What the programs themselves say they know."""

    @staticmethod
    def check_server(test, variables, args=()):
        for name in variables:
            test.assertTrue(name.startswith("LITAGS_") or name in FOREIGN, name)
        code, out = run(PROGRAMS["litags-server"], *args, "--print-config",
                        env={"PATH": os.environ["PATH"], **variables})
        test.assertEqual(code, 0, out)
        known = set(re.findall(r"# environment (\S+)", out))
        test.assertEqual(known, {v for v in variables if v.startswith("LITAGS_")})
        return out

    @staticmethod
    def check_worker(test, variables, args):
        code, out = run(PROGRAMS["litags-worker"], "--help")
        test.assertEqual(code, 0, out)
        known = set(re.findall(r"\(Env:(\S+)\)", out)) | FOREIGN
        test.assertLessEqual(set(variables), known)
        flags = {arg for arg in args if arg.startswith("--")}
        test.assertLessEqual(flags, set(re.findall(r"--[a-z][a-z-]*", out)))


class Kubernetes(unittest.TestCase):

    def test_kinds_and_versions_are_those_of_kubernetes(self):
        for o in base():
            self.assertEqual(o["apiVersion"], API_VERSIONS[o["kind"]])
            self.assertRegex(o["metadata"]["name"], r"^[a-z0-9]([-a-z0-9]*[a-z0-9])?$")
            self.assertNotEqual(o["kind"], "Secret", "secrets are not in the project")

    def test_pods_are_confined(self):
        for name in ("litags-server", "litags-worker"):
            pod = named(base(), "Deployment", name)["spec"]["template"]["spec"]
            self.assertTrue(pod["securityContext"]["runAsNonRoot"])
            self.assertIs(pod["automountServiceAccountToken"], False)
            mine = container(base(), name)
            confined = mine["securityContext"]
            self.assertTrue(confined["readOnlyRootFilesystem"])
            self.assertIs(confined["allowPrivilegeEscalation"], False)
            self.assertEqual(confined["capabilities"], {"drop": ["ALL"]})
            for amounts in (mine["resources"]["requests"], mine["resources"]["limits"]):
                self.assertIn("memory", amounts)
            # What is written lies on volumes of a bounded size.
            mounted = {m["name"] for m in mine["volumeMounts"]}
            self.assertEqual(mounted, {v["name"] for v in pod["volumes"]})
            for volume in pod["volumes"]:
                if "emptyDir" in volume:
                    self.assertIn("sizeLimit", volume["emptyDir"])
            paths = {m["mountPath"] for m in mine["volumeMounts"]}
            self.assertLessEqual({"/data", "/tmp"}, paths)

    def test_the_user_is_that_of_the_image(self):
        with open(os.path.join(DEPLOY, "Dockerfile")) as file:
            uid = int(re.search(r"useradd .*--uid (\d+)", file.read()).group(1))
        for name in ("litags-server", "litags-worker"):
            pod = named(base(), "Deployment", name)["spec"]["template"]["spec"]
            self.assertEqual(pod["securityContext"]["runAsUser"], uid)

    def test_selectors_find_their_pods(self):
        objects = base()
        pods = {o["metadata"]["name"]: o["spec"]["template"]["metadata"]["labels"]
                for o in objects if o["kind"] == "Deployment"}
        wanted = []
        for o in objects:
            spec = o.get("spec", {})
            if o["kind"] == "Service":
                wanted.append(spec["selector"])
            elif o["kind"] == "NetworkPolicy":
                wanted.append(spec["podSelector"]["matchLabels"])
            elif o["kind"] in ("Deployment", "PodDisruptionBudget"):
                wanted.append(spec["selector"]["matchLabels"])
        self.assertEqual(len(wanted), 1 + 2 + 2 + 2)
        for selector in wanted:
            self.assertTrue(any(selector.items() <= labels.items() for labels in pods.values()),
                            selector)
        scaled = named(objects, "HorizontalPodAutoscaler", "litags-worker")["spec"]
        self.assertIn(scaled["scaleTargetRef"]["name"], pods)
        self.assertNotIn("replicas", named(objects, "Deployment", "litags-worker")["spec"])

    def test_ports_are_those_the_server_listens_on(self):
        objects = base()
        server = container(objects, "litags-server")
        ports = {p["name"]: p["containerPort"] for p in server["ports"]}
        variables = environment(objects, server)
        self.assertEqual(variables["LITAGS_SERVER_LISTEN"], f"0.0.0.0:{ports['grpc']}")
        self.assertEqual(variables["LITAGS_SERVER_METRICS_LISTEN"], f"0.0.0.0:{ports['metrics']}")
        service = named(objects, "Service", "litags")["spec"]["ports"]
        self.assertEqual([p["targetPort"] for p in service], ["grpc"])
        pod = named(objects, "Deployment", "litags-server")["spec"]["template"]
        self.assertEqual(int(pod["metadata"]["annotations"]["prometheus.io/port"]), ports["metrics"])
        for probe in ("readinessProbe", "startupProbe", "livenessProbe"):
            self.assertIn(f"localhost:{ports['grpc']}", server[probe]["exec"]["command"])
        for policy in (o for o in objects if o["kind"] == "NetworkPolicy"):
            for rule in policy["spec"]["ingress"]:
                self.assertLessEqual({p["port"] for p in rule["ports"]}, set(ports))

    def test_secrets_are_named_and_have_the_keys_that_are_used(self):
        for name in ("litags-server", "litags-worker"):
            pod = named(base(), "Deployment", name)["spec"]["template"]["spec"]
            mine = pod["containers"][0]
            for variable in mine["env"]:
                if "valueFrom" in variable:
                    reference = variable["valueFrom"]["secretKeyRef"]
                    self.assertIn(reference["key"], SECRETS[reference["name"]])
            mounts = {m["name"]: m["mountPath"] for m in mine["volumeMounts"]}
            files = {f"{mounts[v['name']]}/{key}" for v in pod["volumes"] if "secret" in v
                     for key in SECRETS[v["secret"]["secretName"]]}
            used = re.findall(r"/etc/litags/\S+", " ".join(
                [v.get("value", "") for v in mine["env"]]
                + mine.get("readinessProbe", {}).get("exec", {}).get("command", [])))
            self.assertLessEqual(set(used), files)

    def test_the_programs_know_every_variable_and_flag(self):
        objects = base()
        server, worker = container(objects, "litags-server"), container(objects, "litags-worker")
        self.assertEqual(server["command"], ["litags-server"])
        out = Programs.check_server(self, environment(objects, server), server.get("args", ()))
        self.assertRegex(out, r"(?m)^workers = 0 ")
        self.assertNotIn("secret", re.sub("[a-z]*secret[a-z]* ", "", out))
        self.assertEqual(worker["command"], ["litags-worker"])
        Programs.check_worker(self, environment(objects, worker), worker["args"])
        probe = server["readinessProbe"]["exec"]["command"]
        code, out = run(PROGRAMS[probe[0]], *probe[1:])
        self.assertIn("/etc/litags/tls/ca.crt", out, "the probe gets as far as its file")
        self.assertNotEqual(code, 0)

    def test_commands_in_comments_are_commands(self):
        found = []
        for folder, _, files in os.walk(KUBERNETES):
            for name in files:
                with open(os.path.join(folder, name)) as file:
                    found += re.findall(r"#.*\blitags ([a-z]+)( --[^)\n]*)", file.read())
        self.assertTrue(found)
        for command, rest in found:
            code, out = run(PROGRAMS["litags"], command, "--help")
            self.assertEqual(code, 0, out)
            self.assertLessEqual(set(re.findall(r"--[a-z-]+", rest)),
                                 set(re.findall(r"--[a-z-]+", out)))

    def test_the_database_takes_the_connections_of_all_if_the_docs_are_followed(self):
        with open(os.path.join(DEPLOY, "..", "docs", "scaling.md")) as file:
            text = " ".join(file.read().split())
        server, worker = map(int, re.search(
            r"A server takes (\d+) connections to PostgreSQL at most, a worker (\d+)", text).groups())
        with open(os.path.join(DEPLOY, "..", "server", "store", "postgres_pool.h")) as file:
            pool = int(re.search(r"kMaxConnections = (\d+)", file.read()).group(1))
        self.assertEqual(server, pool + 2, "two listen for changes")
        all_sizes = re.findall(r"(\d+) for the (two|three)[ a-z]* and (\d+)", text)
        self.assertEqual(len(all_sizes), 2)
        for sizes in all_sizes:
            limit, servers, workers = int(sizes[0]), {"two": 2, "three": 3}[sizes[1]], int(sizes[2])
            self.assertGreaterEqual(limit, servers * server + workers * worker + 10)
            folder = "base" if servers == 2 else "overlays/example"
            words = "".join(open(os.path.join(KUBERNETES, folder, name)).read()
                            for name in os.listdir(os.path.join(KUBERNETES, folder)))
            self.assertRegex(words, rf"(replicas|count): {servers}\b")
            self.assertRegex(words, rf"(maxReplicas: |/maxReplicas, value: ){workers}\b")

    def test_pods_get_more_time_to_end_than_they_need(self):
        # A worker ends within 10 s (service/fleet); a server waits 8 s for its own workers, if any.
        for name, least in (("litags-server", 30), ("litags-worker", 30)):
            pod = named(base(), "Deployment", name)["spec"]["template"]["spec"]
            self.assertGreaterEqual(pod["terminationGracePeriodSeconds"], least)

    def test_a_server_may_take_an_hour_to_start(self):
        # Its port opens after a change of the database's layout.
        spec = named(base(), "Deployment", "litags-server")["spec"]
        probe = container(base(), "litags-server")["startupProbe"]
        patience = probe["periodSeconds"] * probe["failureThreshold"]
        self.assertGreaterEqual(patience, 3600)
        self.assertGreater(spec["progressDeadlineSeconds"], patience)

    def test_the_servers_memory_limit_is_more_than_it_takes(self):
        with open(os.path.join(DEPLOY, "..", "docs", "scaling.md")) as file:
            text = file.read()
        table = text.partition("| A server's memory |")[2].partition("\n\n")[0]
        rows = {name: int(mib.replace(",", "")) for name, mib in
                re.findall(r"(?m)^\| (.+) \| ([\d,]+) \|$", table)}
        limit = container(base(), "litags-server")["resources"]["limits"]["memory"]
        self.assertLess(sum(rows.values()), int(limit.removesuffix("Gi")) << 10)
        with open(os.path.join(DEPLOY, "..", "server", "api", "server.h")) as file:
            readers = int(re.search(r"int blob_threads = (\d+)", file.read()).group(1))
        _, out = run(PROGRAMS["litags-server"], "--help")
        for flag in ("scene-cache", "max-unread-bytes"):
            default = int(re.search(rf"--{flag} .*?=(\d+)", out).group(1))
            self.assertEqual(rows[f"`{flag}`"], default >> 20)
        large = next(name for name in rows if "64 megapixels" in name)
        each = int(re.search(r"([\d,]+) MiB each", large).group(1).replace(",", ""))
        self.assertEqual(rows[large], readers * each)
        self.assertIn(f"at most {limit.removesuffix('Gi')} GiB", text)

    def test_the_page_replaces_workers_by_their_names(self):
        with open(os.path.join(DEPLOY, "..", "docs", "scaling.md")) as file:
            (deployment, name), = re.findall(r"set image deployment/(\S+) (\w+)=", file.read())
        self.assertEqual(container(base(), deployment)["name"], name)

    def test_the_autoscalers_metric_is_one_that_the_server_has(self):
        scaler = named(base(), "HorizontalPodAutoscaler", "litags-worker")["spec"]
        metric = scaler["metrics"][0]["external"]["metric"]["name"]
        adapter, = documents(os.path.join(KUBERNETES, "prometheus-adapter.yaml"))
        rule, = adapter["rules"]["external"]
        self.assertEqual(rule["name"]["as"], metric)
        with open(os.environ["LITAGS_METRICS_SOURCE"]) as source:
            names = set(re.findall(r'"(litags_[a-z_]+)"', source.read()))
        self.assertLessEqual(set(re.findall(r"litags_[a-z_]+", rule["metricsQuery"])), names)

    def test_kustomize_builds_base_and_overlay(self):
        plain, example = built("base"), built("overlays/example")
        if plain is None:
            self.skipTest("kubectl is not installed")
        self.assertEqual(len(plain), len(base()))
        self.assertEqual(len(example), len(base()))
        for o in example:
            self.assertEqual(o["metadata"].get("namespace"), "litags")
        for name in ("litags-server", "litags-worker"):
            self.assertRegex(container(example, name)["image"], r"^registry.example.org/litags:\S+$")
        # The overlay's own variables are known, too, and its selectors still find their pods.
        worker = container(example, "litags-worker")
        self.assertIn("LITAGS_WORKER_LABELS", environment(example, worker))
        Programs.check_worker(self, environment(example, worker), worker["args"])
        labels = named(example, "Deployment", "litags-worker")["spec"]["template"]["metadata"]["labels"]
        budget = named(example, "PodDisruptionBudget", "litags-worker")
        self.assertLessEqual(budget["spec"]["selector"]["matchLabels"].items(), labels.items())


class Compose(unittest.TestCase):

    def test_services_are_confined_and_their_variables_known(self):
        for name in ("compose.yaml", "compose.fleet.yaml"):
            compose, = documents(os.path.join(DEPLOY, name))
            for service, spec in compose["services"].items():
                if spec.get("image") != "litags":
                    continue
                with self.subTest(file=name, service=service):
                    self.assertTrue(spec["read_only"])
                    self.assertEqual(spec["cap_drop"], ["ALL"])
                    variables = {key: re.sub(r"\$\{[^}]*\}", "x", str(value))
                                 for key, value in spec["environment"].items()}
                    entry = spec.get("entrypoint", ["litags-server"])[0]
                    args = spec.get("command", [])
                    if entry == "litags-server":
                        Programs.check_server(self, variables, args)
                    else:
                        Programs.check_worker(self, variables, args)

    def test_no_password_is_written_down(self):
        with open(os.path.join(DEPLOY, "compose.fleet.yaml")) as file:
            for line in file:
                if re.search(r"PASSWORD|SECRET|STORE:", line) and ":" in line and "#" not in line[:3]:
                    self.assertRegex(line, r"\$\{\w+:\?", line)


class Unit(unittest.TestCase):

    def setUp(self):
        with open(os.path.join(DEPLOY, "litags-server.service")) as file:
            self.lines = file.read().splitlines()

    def test_a_worker_killed_for_memory_does_not_end_the_service(self):
        self.assertIn("OOMPolicy=continue", self.lines)

    def test_every_setting_is_in_the_file(self):
        # A flag here would beat the operator's line without a word.
        for line in self.lines:
            if line.startswith("ExecStart"):
                self.assertLessEqual(set(re.findall(r"--[a-z-]+", line)), {"--config", "--check"})
        for name in ("server.toml", "debian/server.toml"):
            with open(os.path.join(DEPLOY, name)) as file:
                self.assertIn('data = "/var/lib/litags"', file.read().splitlines())

    def allowed_calls(self):
        """The system calls that the unit leaves: names, and sets of systemd."""
        if not shutil.which("systemd-analyze"):
            self.skipTest("systemd is not installed")
        todo = ["@default"]  # always
        for line in self.lines:
            if line.startswith("SystemCallFilter="):
                todo += line.partition("=")[2].split()
        calls = set()
        while todo:
            name = todo.pop()
            if name.startswith("@"):
                code, out = run("systemd-analyze", "syscall-filter", name)
                self.assertEqual(code, 0, out)
                todo += re.findall(r"(?m)^ +(@?[a-z_0-9-]+)$", out)
            else:
                calls.add(name)
        return calls

    def test_the_server_may_confine_its_children(self):
        # engine/core/file_ruleset.cc and sandbox.cc; refused, they would be taken for a kernel's lack.
        needed = {"landlock_create_ruleset", "landlock_add_rule", "landlock_restrict_self", "seccomp",
                  "prctl", "unshare", "capset"}
        self.assertEqual(needed - self.allowed_calls(), set())

    def test_threads_are_not_counted(self):
        # COLMAP makes two threads for each core: no number is right for every machine.
        self.assertFalse([line for line in self.lines if line.startswith("TasksMax=")])


class Stop(unittest.TestCase):

    def test_it_is_no_error_that_children_are_told_to_end(self):
        server = self.server_with_a_reader()
        with open(os.path.join(DEPLOY, "litags-server.service")) as file:
            mixed = "KillMode=mixed" in file.read().splitlines()
        for pid in [server.pid] if mixed else processes(server.pid):  # as systemd does
            os.kill(pid, signal.SIGTERM)
        self.assert_ends_without_error(server)

    def test_ctrl_c_is_no_error(self):
        server = self.server_with_a_reader()
        os.killpg(server.pid, signal.SIGINT)
        self.assert_ends_without_error(server)

    def server_with_a_reader(self):
        """A server that has taken a file, which a child of its has read."""
        folder = tempfile.mkdtemp(prefix="litags-stop-")
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        self.log, port = os.path.join(folder, "log"), os.path.join(folder, "port")
        with open(self.log, "w") as log:
            server = subprocess.Popen(
                [PROGRAMS["litags-server"], "--listen", "127.0.0.1:0", "--port-file", port,
                 "--data", os.path.join(folder, "data")], stdout=log, stderr=log, start_new_session=True)
        self.addCleanup(server.wait)
        self.addCleanup(server.kill)
        end = time.monotonic() + PATIENCE_S
        while not os.path.exists(port):
            self.assertLess(time.monotonic(), end, "the server did not start")
            time.sleep(0.05)
        with open(os.path.join(folder, "a.png"), "wb") as file:
            file.write(b"\x89PNG\r\n\x1a\n")  # reading finds out that this is all
        with open(port) as file:
            _, out = run(PROGRAMS["litags"], "--server", "127.0.0.1:" + file.read().strip(), "submit", folder)
        self.assertIn("IMAGE_TRUNCATED", out)
        self.assertGreater(len(processes(server.pid)), 2, "server, worker and reader")
        return server

    def assert_ends_without_error(self, server):
        code = server.wait(PATIENCE_S)
        with open(self.log) as file:
            log = file.read()
        self.assertEqual(code, 0, log)
        self.assertNotIn(" error ", log)


class Image(unittest.TestCase):

    def test_the_dockerfile_is_in_stages_and_does_not_run_as_root(self):
        with open(os.path.join(DEPLOY, "Dockerfile")) as file:
            lines = [line.strip() for line in file if line.strip() and not line.startswith("#")]
        stages = [line for line in lines if line.startswith("FROM")]
        self.assertEqual(len(stages), 2)
        last = lines[lines.index(stages[-1]):]
        self.assertIn("USER litags", last)
        self.assertTrue(any("bootstrap --runtime" in line for line in last))
        copied = set(re.findall(r"build/release/bin/(\S+)", " ".join(last)))
        self.assertLessEqual(set(PROGRAMS), copied)


    def test_the_packages_of_the_image_hold_every_library_of_the_programs(self):
        if not shutil.which("dpkg-query"):
            self.skipTest("packages are those of Debian")
        with open(os.path.join(DEPLOY, "bootstrap")) as file:
            wanted = re.search(r"runtime_packages=\(\n(.*?)\n\)", file.read(), re.S).group(1).split()
        _, out = run("dpkg-query", "-W", "-f", "${Package}|${Pre-Depends}, ${Depends}\\n")
        depends = {}
        for line in out.splitlines():
            package, _, rest = line.partition("|")
            depends[package] = re.findall(r"[a-z0-9][a-z0-9.+-]+(?=[ ,:|]|$)",
                                          re.sub(r"\([^)]*\)", " ", rest))
        installed, todo = set(), [p for p in wanted if p in depends]
        while todo:
            package = todo.pop()
            if package in depends and package not in installed:
                installed.add(package)
                todo += depends[package]
        libraries = set()
        for name in ("litags-server", "litags-worker", "litags", "litags-train"):
            program = os.path.join(BIN, name)
            if not os.path.exists(program):
                continue  # not built here
            _, out = run("objdump", "-p", program)
            paths = dict(re.findall(r"(\S+) => (/\S+)", run("ldd", program)[1]))
            needed = re.findall(r"NEEDED +(\S+)", out)
            libraries |= {os.path.realpath(paths[n]) for n in needed if n in paths}  # the loader is not
        if not libraries:
            self.skipTest("the programs are not built here")
        if any(re.match("lib[at]san", os.path.basename(path)) for path in libraries):
            self.skipTest("the programs are built with sanitizers, not for an image")
        # Packages from before /lib was /usr/lib name it so.
        _, out = run("dpkg-query", "-S", *libraries, *(p.removeprefix("/usr") for p in libraries))
        owners = {path: package for package, path in
                  re.findall(r"(?m)^([^:\s]+):\S* (/\S+)$", out)}
        for path in sorted(libraries):
            package = owners.get(path) or owners.get(path.removeprefix("/usr"))
            self.assertTrue(package in installed, f"{path} is of {package}")


if __name__ == "__main__":
    skipping.run_tests()
