"""Logs of messages: MCAP files and ROS bags, of which each is a run on its own.

``mcap_file``    the records of an MCAP file, whole or cut; ``mcap_magic`` and ``mcap_chunks`` are parts of it
``bags``         ROS 1 and ROS 2 bags, handed on as the channels of an MCAP file are
``definitions``  the ROS types, and the texts that define them
``layout``       columns out of many messages of one layout: ``ros`` and ``protobuf`` walk one, ``json_values`` parses
``topics``       the messages of every topic as columns, under names of our own
``wheels``, ``heading`` and ``fixes``  the streams out of such columns
``converted``    the tables of a log that was converted, as they were
``read``         which topics are the streams: a whole log read
``write``        streams as the messages of an MCAP file
"""
