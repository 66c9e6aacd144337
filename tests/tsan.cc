// What ThreadSanitizer is told. In the programs themselves: children that read strangers' files can
// open no other file.

// Debian's libraries are not instrumented, so ThreadSanitizer cannot see how they synchronise. What
// they do themselves is not reported. Our own code is, save where it shares memory with a thread of
// gRPC, whose hand-overs it cannot see either. InodeOf looks whether a descriptor that gRPC may
// have closed is still that of the same connection. References to a status are given up in Abseil's
// library, so that the last one seems to delete it while others still hold it.
extern "C" const char* __tsan_default_suppressions() {
  return R"(
deadlock:libgdal.so
called_from_lib:libgdal.so
called_from_lib:libtbb.so
race:libtbb.so
race:libx265.so
race:libopencv_dnn.so
race:libspdlog.so
race:libgrpc.so
race:libgrpc++.so
race:libgpr.so
race:libssl.so
race:libcrypto.so
race:libupb.so
race:libabsl_
race:absl::*::Status::Unref
race:libprotobuf.so
race:^grpc::
race:^google::protobuf::
race:^litags::v1::
thread:grpc_core::Thread::Thread
race:InodeOf
)";
}

// Else every byte that threads of gRPC share would be looked for among all those before it.
extern "C" const char* __tsan_default_options() { return "suppress_equal_addresses=0"; }
