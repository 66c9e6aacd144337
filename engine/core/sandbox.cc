#include "engine/core/sandbox.h"

#include <linux/audit.h>
#include <linux/capability.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>

namespace litags {
namespace {

#if defined(__x86_64__)
constexpr uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr uint32_t kArchitecture = 0;
#endif

// Names, and beginnings of names, that hold no secret by what they are for.
constexpr std::string_view kNames[] = {"PATH",   "HOME", "USER",     "LOGNAME",
                                       "TMPDIR", "LANG", "LANGUAGE", "TZ"};
constexpr std::string_view kBeginnings[] = {
    "LD_LIBRARY_",
    "LC_",                  // messages
    "QT_",         "XDG_",  // COLMAP is a Qt program
    "OMP_",        "GOMP_",   "OPENBLAS_",
    "MKL_",        "OPENCV_",  // threads
    "MALLOC_",     "ASAN_",   "LSAN_",
    "TSAN_",       "UBSAN_"};  // glibc's memory, builds with sanitizers

bool MaySee(std::string_view name) {
  return std::find(std::begin(kNames), std::end(kNames), name) != std::end(kNames) ||
         std::any_of(std::begin(kBeginnings), std::end(kBeginnings),
                     [&](std::string_view beginning) { return name.starts_with(beginning); });
}

std::string_view NameOf(std::string_view entry) { return entry.substr(0, entry.find('=')); }

constexpr int kNoSuchCall = -1;

constexpr int kRefusedToPrograms[] = {
    // Other processes.
    SYS_process_vm_readv,
    SYS_process_vm_writev,
    SYS_kcmp,
    SYS_pidfd_getfd,
    kBuiltWithSanitizer ? kNoSuchCall : SYS_ptrace,
    // Namespaces and mounts.
    SYS_unshare,
    SYS_setns,
    SYS_mount,
    SYS_umount2,
    SYS_move_mount,
    SYS_open_tree,
    SYS_fsopen,
    SYS_fsconfig,
    SYS_fsmount,
    SYS_fspick,
    SYS_pivot_root,
    SYS_chroot,
    SYS_open_by_handle_at,
    // The kernel and the machine.
    SYS_bpf,
    SYS_perf_event_open,
    SYS_userfaultfd,
    SYS_keyctl,
    SYS_add_key,
    SYS_request_key,
    SYS_init_module,
    SYS_finit_module,
    SYS_delete_module,
    SYS_kexec_load,
    SYS_kexec_file_load,
    SYS_reboot,
    SYS_swapon,
    SYS_swapoff,
    SYS_acct,
    SYS_quotactl,
    SYS_syslog,
    SYS_settimeofday,
    SYS_clock_settime,
    SYS_clock_adjtime,
    SYS_sethostname,
    SYS_setdomainname,
#if defined(__x86_64__)
    SYS_iopl,
    SYS_ioperm,
#endif
};

constexpr int kEnoughToCompute[] = {
    SYS_read,    SYS_write,         SYS_readv,        SYS_writev,      SYS_recvmsg,
    SYS_sendmsg, SYS_close,         SYS_lseek,        SYS_fstat,       SYS_mmap,
    SYS_munmap,  SYS_mremap,        SYS_mprotect,     SYS_madvise,     SYS_brk,
    SYS_futex,   SYS_clock_gettime, SYS_getrandom,    SYS_sched_yield, SYS_sched_getaffinity,
    SYS_getpid,  SYS_gettid,        SYS_rt_sigreturn, SYS_exit,        SYS_exit_group};
// A sanitizer besides: when a thread begins or ends, to see whether memory is there, and in the
// thread that TSan keeps.
constexpr int kEnoughToSanitize[] = {SYS_sigaltstack,     SYS_pipe2,          SYS_rseq,
                                     SYS_set_robust_list, SYS_rt_sigprocmask, SYS_clock_nanosleep};

constexpr sock_filter Statement(int code, uint32_t value) {
  return BPF_STMT(static_cast<uint16_t>(code), value);
}

constexpr sock_filter Jump(int test, uint32_t value, int if_true, int if_false) {
  return BPF_JUMP(static_cast<uint16_t>(BPF_JMP | BPF_K | test), value,
                  static_cast<uint8_t>(if_true), static_cast<uint8_t>(if_false));
}

constexpr sock_filter Load(size_t offset) {
  return Statement(BPF_LD | BPF_W | BPF_ABS, static_cast<uint32_t>(offset));
}

constexpr sock_filter Return(uint32_t action) { return Statement(BPF_RET | BPF_K, action); }

constexpr uint32_t Refuse(int error) { return SECCOMP_RET_ERRNO | static_cast<uint32_t>(error); }

// The low half of the first argument; both processors are little-endian.
constexpr size_t kFirstArgument = offsetof(seccomp_data, args);

using Program = std::vector<sock_filter>;

void Append(Program* program, std::initializer_list<sock_filter> lines) {
  program->insert(program->end(), lines);
}

// Leaves the number of the call in the accumulator. Calls in another processor's way end the
// process: their numbers mean other things.
Program Begin() {
  Program program = {Load(offsetof(seccomp_data, arch)), Jump(BPF_JEQ, kArchitecture, 1, 0),
                     Return(SECCOMP_RET_KILL_PROCESS), Load(offsetof(seccomp_data, nr))};
#if defined(__x86_64__)
  constexpr uint32_t kX32 = 0x40000000;
  Append(&program, {Jump(BPF_JGE, kX32, 0, 1), Return(Refuse(ENOSYS))});
#endif
  return program;
}

void AddRule(Program* program, int call, uint32_t action) {
  Append(program, {Jump(BPF_JEQ, static_cast<uint32_t>(call), 0, 1), Return(action)});
}

// `action` if the first argument passes the test.
void AddRule(Program* program, int call, int test, uint32_t value, bool passes, uint32_t action) {
  Append(program, {Jump(BPF_JEQ, static_cast<uint32_t>(call), 0, 4), Load(kFirstArgument),
                   Jump(test, value, passes ? 0 : 1, passes ? 1 : 0), Return(action),
                   Load(offsetof(seccomp_data, nr))});
}

}  // namespace

std::vector<std::string> ChildEnvironment(const std::vector<std::string>& changes) {
  std::vector<std::string> environment;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view name = NameOf(*entry);
    const bool replaced = std::any_of(changes.begin(), changes.end(),
                                      [&](const std::string& c) { return NameOf(c) == name; });
    if (!replaced && MaySee(name)) environment.emplace_back(*entry);
  }
  environment.insert(environment.end(), changes.begin(), changes.end());
  return environment;
}

SyscallFilter SyscallFilter::ForProgram(Sockets sockets) {
  constexpr uint32_t kNewNamespaces = CLONE_NEWNS | CLONE_NEWCGROUP | CLONE_NEWUTS | CLONE_NEWIPC |
                                      CLONE_NEWUSER | CLONE_NEWPID | CLONE_NEWNET;
  SyscallFilter filter;
  Program& program = filter.program_ = Begin();
  for (const int call : kRefusedToPrograms) AddRule(&program, call, Refuse(EPERM));
  // "Not there": the C library then uses clone, whose flags a filter can see.
  AddRule(&program, SYS_clone3, Refuse(ENOSYS));
  AddRule(&program, SYS_clone, BPF_JSET, kNewNamespaces, true, Refuse(EPERM));
  for (const int call : {SYS_io_uring_setup, SYS_io_uring_enter, SYS_io_uring_register}) {
    AddRule(&program, call, Refuse(ENOSYS));
  }
  if (sockets == Sockets::kNone) AddRule(&program, SYS_socket, Refuse(EACCES));
  if (sockets == Sockets::kLocal) {
    AddRule(&program, SYS_socket, BPF_JEQ, AF_UNIX, false, Refuse(EACCES));
  }
  program.push_back(Return(SECCOMP_RET_ALLOW));
  return filter;
}

SyscallFilter SyscallFilter::ForComputing() {
  SyscallFilter filter;
  filter.program_ = Begin();
  for (const int call : kEnoughToCompute) AddRule(&filter.program_, call, SECCOMP_RET_ALLOW);
  if (kBuiltWithSanitizer) {
    for (const int call : kEnoughToSanitize) AddRule(&filter.program_, call, SECCOMP_RET_ALLOW);
  }
  filter.program_.push_back(Return(Refuse(EPERM)));
  return filter;
}

bool SyscallFilter::Supported() {
  // A kernel that has them looks at the filter, and there is none; see seccomp(2).
  return kArchitecture != 0 && prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, nullptr, 0, 0) != 0 &&
         errno == EFAULT;
}

int SyscallFilter::Apply() const {
  if (kArchitecture == 0) return ENOSYS;
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return errno;
  const sock_fprog program = {static_cast<unsigned short>(program_.size()),
                              const_cast<sock_filter*>(program_.data())};
  // For the threads, too, that libraries may have started.
  if (syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, SECCOMP_FILTER_FLAG_TSYNC, &program) == 0) {
    return 0;
  }
  return prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) == 0 ? 0 : errno;
}

int KeepFilePowersOnly() {
  constexpr uint32_t kFilePowers = 1u << CAP_CHOWN | 1u << CAP_DAC_OVERRIDE |
                                   1u << CAP_DAC_READ_SEARCH | 1u << CAP_FOWNER | 1u << CAP_FSETID;
  __user_cap_header_struct header = {_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct powers[_LINUX_CAPABILITY_U32S_3] = {};
  if (syscall(SYS_capget, &header, powers) != 0) return errno;
  powers[0].permitted &= kFilePowers;
  powers[1].permitted = 0;
  for (__user_cap_data_struct& part : powers) {
    part.effective = part.permitted;
    part.inheritable = 0;
  }
  return syscall(SYS_capset, &header, powers) == 0 ? 0 : errno;
}

void LimitResource(__rlimit_resource resource, int64_t value, int64_t more) {
  const rlimit limit = {static_cast<rlim_t>(value), static_cast<rlim_t>(value + more)};
  setrlimit(resource, &limit);
}

void HideFromOtherProcesses() {
  if (!kBuiltWithSanitizer) prctl(PR_SET_DUMPABLE, 0, 0, 0, 0);
}

}  // namespace litags
