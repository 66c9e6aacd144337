// Inside this module: which pictures of a HEIC or AVIF file are made of which others.
#ifndef LITAGS_ENGINE_IO_HEIF_REFERENCES_H_
#define LITAGS_ENGINE_IO_HEIF_REFERENCES_H_

#include <string>
#include <string_view>

namespace litags {

// Whether libheif may decode the file: it follows derived pictures (references "dimg", ISO/IEC
// 14496-12 and 23008-12) without end. False: one is made of itself, of more than eight others in a
// chain, or all together of more than 2^17 pictures. What cannot be parsed has no references.
bool HeifReferencesEnd(std::string_view bytes);

// The file, of the same size, without the references that make pictures alpha, depth, gain maps or
// thumbnails of others: libheif does not decode them then, nor refuse those of more pictures than
// one (1.15), as iPhones write them since iOS 18. Metadata that tell of the primary picture are its
// alone. Empty: the file is that already.
std::string WithoutOtherPictures(std::string_view bytes);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_HEIF_REFERENCES_H_
