#include "engine/video/frame_process.h"

int main(int argc, char** argv) { return litags::MaybePickFrames(argc, argv).value_or(2); }
