#ifndef LITAGS_TESTS_FUZZ_HTTP_SEEDS_H_
#define LITAGS_TESTS_FUZZ_HTTP_SEEDS_H_

#include <map>
#include <string>

namespace litags {

// What browsers send to the page, by name: one request of each route, and the odd ones.
std::map<std::string, std::string> HttpSeeds();

}  // namespace litags

#endif  // LITAGS_TESTS_FUZZ_HTTP_SEEDS_H_
