// Inside this module: which pictures of a HEIC or AVIF file are made of which others.
#ifndef LITAGS_ENGINE_IO_HEIF_REFERENCES_H_
#define LITAGS_ENGINE_IO_HEIF_REFERENCES_H_

#include <string_view>

namespace litags {

// Whether libheif may decode the file: it follows derived pictures (references "dimg", ISO/IEC
// 14496-12 and 23008-12) without end. False: one is made of itself, of more than eight others in a
// chain, or all together of more than 2^17 pictures. What cannot be parsed has no references.
bool HeifReferencesEnd(std::string_view bytes);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_HEIF_REFERENCES_H_
