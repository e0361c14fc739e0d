#pragma once

#include <dcmtk/dcmdata/dcpixel.h>
#include <dcmtk/dcmdata/dcxfer.h>

/// What differs between DCMTK 3.6.7 (Debian 12) and 3.6.9 (Debian 13).
namespace limn::scene {

/// Whether a transfer syntax stores the pixels in fragments, as all compressed ones do.
template <class Xfer>
bool uses_encapsulated_format(const Xfer& xfer) {
  if constexpr (requires { xfer.usesEncapsulatedFormat(); })
    return xfer.usesEncapsulatedFormat();
  else
    return xfer.isEncapsulated();
}

/// The bytes of a frame without compression and padding.
template <class Pixels>
OFCondition uncompressed_frame_size(const Pixels& pixels, DcmItem* data, bool is_uncompressed, Uint32* size) {
  if constexpr (requires { pixels.getUncompressedFrameSize(data, *size, OFTrue); })
    return pixels.getUncompressedFrameSize(data, *size, is_uncompressed ? OFTrue : OFFalse);
  else
    return pixels.getUncompressedFrameSize(data, *size);
}

}  // namespace limn::scene
