#ifndef LITAGS_SERVER_TESTING_TEMP_DIR_H_
#define LITAGS_SERVER_TESTING_TEMP_DIR_H_

#include "engine/core/temp_dir_test_util.h"  // TempDir

#endif  // LITAGS_SERVER_TESTING_TEMP_DIR_H_
