/* Numbers as little-endian bytes, written to and read from memory; and FNV-1a, the hash of both. */
#ifndef SPHM_CORE_BYTES_H
#define SPHM_CORE_BYTES_H

#include "sph_muscle/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Start of an FNV-1a hash (Fowler, Noll, Vo; 64 bits), and its continuation. */
#define SPHM_HASH_START 14695981039346656037u
uint64_t sphm_hash_bytes(uint64_t hash, const void *data, size_t size);
/* Hash of `count` numbers of `size` bytes each (1, 2, 4 or 8) as little-endian bytes. */
uint64_t sphm_hash_numbers(uint64_t hash, const void *data, size_t count, size_t size);

/* A growing buffer; a zeroed one is empty. `lost` is set when memory ran out, and then all else is ignored.
 */
typedef struct sphm_writer {
    unsigned char *data;
    size_t size, capacity;
    int lost;
} sphm_writer;

void sphm_write_bytes(sphm_writer *writer, const void *data, size_t size);
void sphm_write_number(sphm_writer *writer, const void *number, size_t size); /* size 1, 2, 4 or 8 */
void sphm_write_u32(sphm_writer *writer, uint32_t value);
void sphm_write_u64(sphm_writer *writer, uint64_t value);
void sphm_write_double(sphm_writer *writer, double value);
void sphm_write_text(sphm_writer *writer, const char *text); /* length, then bytes */

/* A place in memory that must not run over its end. `short_of` is set when it would, and then numbers read as
 * 0. */
typedef struct sphm_reader {
    const unsigned char *data;
    size_t size, at;
    int short_of;
} sphm_reader;

void sphm_read_number(sphm_reader *reader, void *number, size_t size);
uint32_t sphm_read_u32(sphm_reader *reader);
uint64_t sphm_read_u64(sphm_reader *reader);
double sphm_read_double(sphm_reader *reader);
/* Reads what sphm_write_text() wrote; one of `size` bytes or more counts as running over the end. */
void sphm_read_text(sphm_reader *reader, char *text, size_t size);

#ifdef __cplusplus
}
#endif
#endif
