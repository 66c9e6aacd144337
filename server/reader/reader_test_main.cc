#include "server/reader/read_files_main.h"

int main() { return litags::ReadFilesMain(); }
